//! [`Compiled`]: a program with memory for its runs, which the next run uses again.

use super::crossed::Crossed;
use super::interleaved::Idle;
use super::late::Late;
use super::settling::Settling;
use crate::aligned::Aligned;
use crate::engine::{Group, Program};
use crate::sweep::Window;
use std::sync::{Arc, Mutex, PoisonError};

/// Samples per window. Windows are counted from the begin of each piece, so that a lane's bits do not depend on the
/// length of another.
pub(super) const WINDOW: usize = 64;

/// A program, and the memory of the runs that have ended: a fit runs it some ten times, a fleet thousands of times.
pub(super) struct Compiled {
    pub program: Program,
    /// Where inputs have dead times.
    pub late: Option<Late>,
    /// Where linear equations are crossed exactly.
    pub crossed: Option<Arc<Crossed>>,
    /// Where the covariance of a filter may settle.
    pub settling: Option<Settling>,
    idle: Mutex<Vec<Workspace>>,
    pub columns: Arc<Idle>,
}

/// Memory of a run.
pub(super) struct Workspace {
    pub group: Group,
    /// Sample, column, lane.
    pub inputs: Aligned,
    /// Sample, output, lane: as measured.
    pub measured: Aligned,
    /// Where variances are predicted, all rows of each sample.
    pub rows: Vec<f64>,
    /// First sample of each lane.
    pub begins: Vec<usize>,
    pub window: Window,
}

impl Compiled {
    pub fn new(
        program: Program,
        late: Option<Late>,
        crossed: Option<Arc<Crossed>>,
        settling: Option<Settling>,
    ) -> Self {
        Compiled { program, late, crossed, settling, idle: Mutex::new(vec![]), columns: Arc::default() }
    }

    /// Memory for a run of so many pieces. Lanes, steps and samples are to be set.
    pub fn workspace(&self, pieces: usize) -> Workspace {
        let lanes = self.program.lanes_for(pieces);
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let known = idle.iter().position(|space| space.group.lanes() == lanes).map(|at| idle.swap_remove(at));
        drop(idle);
        known.unwrap_or_else(|| Workspace::new(&self.program, pieces))
    }

    /// Takes memory back.
    pub fn keep(&self, mut space: Workspace) {
        space.window.forget();
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(space);
    }
}

impl Workspace {
    fn new(program: &Program, pieces: usize) -> Self {
        let group = program.group(pieces);
        let (lanes, variances) = (group.lanes(), program.variances() > 0);
        let rows = WINDOW + usize::from(program.reads_next());
        let mut window = Window::new(lanes, program.outputs(), program.seeds().len(), WINDOW, variances);
        window.carry = vec![0.0; program.carried() * lanes];
        window.width = program.width();
        Workspace {
            group,
            inputs: Aligned::zeros(rows * program.columns().len() * lanes),
            measured: Aligned::zeros(WINDOW * program.outputs() * lanes),
            rows: if variances { vec![0.0; WINDOW * program.row_length() * lanes] } else { vec![] },
            begins: vec![0; lanes],
            window,
        }
    }
}
