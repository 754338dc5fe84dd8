//! How the cost fell from iteration to iteration.

use crate::optimize::LeastSquaresState;
use crate::section::{Axis, Cell, Curves, Drawing, Layer, Plot, Section, Style, Table};
use argmin::core::observers::Observe;
use argmin::core::{KV, State};
use std::sync::{Arc, Mutex, PoisonError};

/// The course of a search. It is an observer that a fit is given a clone of, and a section of a report:
///
/// ```
/// # use greybox::{Experiment, Fit, Kind, Model, Nothing, Scalar, Time, free, signals};
/// # signals! { pub struct Load { f: "N" } pub struct Length { y: "m" } pub struct Spring { k: "N/m" } }
/// # #[derive(Clone)]
/// # struct Hooke;
/// # impl Model for Hooke {
/// #     type State = Nothing; type Input = Load; type Output = Length; type Parameters = Spring;
/// #     const KIND: Kind = Kind::Static;
/// #     fn output<S: Scalar>(&self, _: S, _: &Nothing, u: &Load<S>, p: &Spring<S>) -> Length<S> {
/// #         Length { y: u.f / p.k }
/// #     }
/// # }
/// # let loads: Vec<Load> = (0..60).map(|k| Load { f: f64::from(k % 7) }).collect();
/// # let lengths = loads.iter().enumerate().map(|(k, u)| Length { y: u.f / 20.0 + 1e-3 * (k as f64).sin() }).collect();
/// # let record = Experiment::new(&Hooke, Time::Uniform { start: 0.0, step: 1.0 }, loads, lengths)?;
/// # let model = Hooke;
/// use argmin::core::observers::ObserverMode;
/// use greybox::diagnose::Convergence;
/// let convergence = Convergence::default();
/// let fit = Fit::new(&model, &record).parameters(Spring { k: free(10.0) });
/// let estimate = fit.observe(convergence.clone(), ObserverMode::Always).run()?;
/// assert!(convergence.iterations().windows(2).all(|pair| pair[1].1 <= pair[0].1));
/// # Ok::<(), greybox::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Convergence(Arc<Mutex<Vec<(u64, f64)>>>);

impl Convergence {
    /// The course of a search that was kept elsewhere: number of each iteration, zero for the start, and the cost after it.
    pub fn new(iterations: Vec<(u64, f64)>) -> Convergence {
        Convergence(Arc::new(Mutex::new(iterations)))
    }

    /// The iterations so far: number, and cost after it.
    pub fn iterations(&self) -> Vec<(u64, f64)> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn note(&self, iteration: u64, state: &LeastSquaresState) {
        let mut iterations = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        iterations.push((iteration, state.get_cost()));
    }
}

impl Observe<LeastSquaresState> for Convergence {
    fn observe_init(&mut self, _: &str, state: &LeastSquaresState, _: &KV) -> Result<(), argmin::core::Error> {
        self.note(state.get_iter(), state);
        Ok(())
    }

    // argmin counts an iteration after it was observed.
    fn observe_iter(&mut self, state: &LeastSquaresState, _: &KV) -> Result<(), argmin::core::Error> {
        self.note(state.get_iter() + 1, state);
        Ok(())
    }
}

/// The cost over the iterations, and what it was above the last.
impl From<&Convergence> for Section {
    fn from(convergence: &Convergence) -> Section {
        const LISTED: usize = 50;
        let iterations = convergence.iterations();
        let (Some((first, _)), Some((_, last))) = (iterations.first(), iterations.last()) else {
            return Section::new("convergence", "Course of the search").says("No iteration was kept.");
        };
        let above = |cost: f64| cost - last;
        let points = iterations.iter().map(|(i, cost)| (*i as f64, above(*cost))).filter(|(_, y)| *y > 0.0).collect();
        let drawing = Curves {
            x: Axis::new("iteration", "").from(*first as f64),
            y: Axis::new("cost above the last", "").logarithmic(),
            layers: vec![Layer::Line { style: Style::Main, points }],
        };
        let row = |(i, cost): &(u64, f64)| [(*i).into(), Cell::number(*cost, 8), Cell::number(above(*cost), 3)];
        let table = Table::new("Iterations", ["iteration", "cost", "above the last"]).rows(iterations.iter().map(row));
        let title = "Cost of each iteration above that of the last one";
        let plot = Plot::of("convergence", "How the cost fell", title, Drawing::Curves(drawing));
        Section::new("convergence", "Course of the search").plot(plot).table(table.at_most(LISTED)).folded()
    }
}

impl From<Convergence> for Section {
    fn from(convergence: Convergence) -> Section {
        Section::from(&convergence)
    }
}
