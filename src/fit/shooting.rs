//! Multiple shooting for far starts: the records in pieces that begin near the measurements, and continuity asked for step by step.

use super::moves::{Movement, NEAR};
use crate::optimize::{Domain, LeastSquares, LevenbergMarquardt, Machine, OwnSize, Request, Stop};
use crate::numeral::number;
use crate::problem::{Control, Objective, Problem, Shooting, Whitening};
use crate::record::Record;
use std::fmt;

fn tune(name: &str, default: f64) -> f64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// The least noise of an output that pieces are compared with, as a part of half its range.
const LEAST_NOISE: f64 = 0.01;
/// The least samples of a piece.
const LEAST: usize = 8;
/// Pieces from the start explain the outputs where their error is at most this part of half the range; else they are halved.
const EXPLAINED: f64 = 0.2;
/// Pieces of a quarter of the length follow where longer ones do not lead to the measurements.
const SHORTER: usize = 4;
/// A search with fixed multipliers ends where the next step would lower the cost by this part, or after so many trial steps.
const INNER: Stop = Stop { step: 1e-10, gradient: 1e-8, cost: 1e-6, iterations: 20 };
/// The most searches.
const ROUNDS: usize = 40;
/// The penalty is raised where the largest gap did not shrink to this part.
const SHRUNK: f64 = 0.25;
/// So many searches in which the largest gap does not shrink to this part are the last ones.
const STUCK: usize = 6;
/// Continuity is closed where the largest gap is at most this part of the noise.
const CLOSED: f64 = 1e-9;

/// The end of multiple shooting.
pub(super) struct Shot {
    pub coordinates: Vec<f64>,
    /// The samples at which the nodes of each record stand, and their states.
    pub nodes: Vec<Vec<(usize, Vec<f64>)>>,
    pub pieces: usize,
    pub evaluations: u64,
    /// The largest gap, in units of the noise.
    pub gap: f64,
    /// The root of the mean square error of the pieces, in units of the noise.
    pub misfit: f64,
}

impl Shot {
    /// Whether continuity is closed and the errors are near the noise: a wrong minimum may be closed, too.
    pub fn explains(&self) -> bool {
        self.gap <= CLOSED && self.misfit <= NEAR
    }
}

impl fmt::Display for Shot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (pieces, gap, misfit) = (self.pieces, number(self.gap, 1), number(self.misfit, 2));
        write!(f, "multiple shooting ({pieces} pieces; in units of the noise, the largest gap is {gap} and the rms error {misfit})")
    }
}

/// What does not change with the length of the pieces.
struct Aim<'s> {
    objective: Objective<'s>,
    /// By which nodes are found, if there is a filter.
    filter: Option<Objective<'s>>,
    start: &'s [f64],
    sizes: Vec<f64>,
    /// The noise as a part of half the range, the largest of all outputs.
    part: f64,
    /// Pieces with a larger misfit explain nothing.
    unexplained: f64,
    /// The number of measurements.
    rows: usize,
}

/// Multiple shooting from a start. The nodes are at first the states of a filter that is near the measurements, or the measured states.
///
/// # Errors
/// Why there are no pieces that can be run.
pub(super) fn shoot(
    (problem, movement, filter): (&Problem<'_>, &Movement, Option<&Problem<'_>>),
    start: &[f64],
    control: &Control,
) -> Result<Shot, &'static str> {
    let longest = problem.records.iter().map(Record::len).max().unwrap_or(0);
    if longest < 2 * LEAST {
        return Err("no record has two pieces of eight samples");
    }
    let filter = filter.map(|filter| filter.in_units(control));
    let aim = Aim::new(problem, movement, filter, start, control).ok_or("the outputs are undefined at the start")?;
    let length = (tune("MS_LENGTH", 1.0) / (movement.rate * movement.step)) as usize;
    let mut length = length.clamp(LEAST, longest / 2);
    let (mut best, mut evaluations): (Option<Shot>, u64) = (None, 0);
    loop {
        let (explained, shooting, x) = aim.explained(length)?;
        length = explained;
        let shot = aim.shot(shooting, x, control).ok_or("the search was stopped")?;
        evaluations += shot.evaluations;
        let order = |shot: &Shot| (shot.gap > CLOSED, shot.misfit);
        if best.as_ref().is_none_or(|best| order(&shot) < order(best)) {
            best = Some(shot);
        }
        if best.as_ref().is_some_and(Shot::explains) || length <= LEAST || control.stops() {
            break;
        }
        length = (length / SHORTER).max(LEAST);
    }
    best.map(|shot| Shot { evaluations, ..shot }).ok_or("the search was stopped")
}

impl<'s> Aim<'s> {
    fn new(
        problem: &'s Problem<'s>,
        movement: &Movement,
        filter: Option<Objective<'s>>,
        start: &'s [f64],
        control: &'s Control,
    ) -> Option<Self> {
        let positive = |value: f64| if value > 0.0 { value } else { 1.0 };
        let noise = movement.outputs.iter().map(|moves| moves.noise.max(tune("MS_NOISE", LEAST_NOISE) * moves.half));
        let sigma: Vec<f64> = noise.map(positive).collect();
        let parts = movement.outputs.iter().zip(&sigma).filter(|(moves, _)| moves.half > 0.0);
        let part = parts.clone().map(|(moves, sigma)| sigma / moves.half).fold(0.0, f64::max);
        let squares = parts.clone().map(|(moves, sigma)| (moves.half / sigma).powi(2)).sum::<f64>();
        let unexplained = tune("MS_EXPLAINED", EXPLAINED) * (squares / parts.count() as f64).sqrt();
        let sizes = problem.scales(problem.records.first()?, movement.rate)?.into_iter().map(positive).collect();
        let outputs = problem.records.iter().flat_map(Record::outputs);
        let rows = outputs.map(|output| output.values.iter().filter(|y| !y.is_nan()).count()).sum();
        let objective = problem.in_units(control).with(Whitening::Diagonal(sigma));
        Some(Aim { objective, filter, start, sizes, part, unexplained, rows })
    }

    /// The root of the mean square error of the pieces.
    fn misfit(&self, cost: f64) -> f64 {
        (2.0 * cost / self.rows.max(1) as f64).sqrt()
    }

    /// Pieces that explain the outputs at the start, of at most so many samples, or the shortest ones.
    fn explained(&self, mut length: usize) -> Result<(usize, Shooting<'_>, Vec<f64>), &'static str> {
        loop {
            let penalty = tune("MS_PENALTY", 1.0) * self.part.powi(-2);
            let shooting = Shooting::new(&self.objective, length, self.sizes.clone(), penalty);
            let nodes = (0..self.objective.experiments()).map(|e| self.nodes(e, &shooting.nodes_at(e)));
            let nodes: Vec<Vec<Vec<f64>>> = nodes.collect::<Result<_, _>>()?;
            let x = shooting.point(self.start, &nodes);
            let misfit = shooting.pass(&x).map_or(f64::INFINITY, |passed| self.misfit(passed.cost));
            if std::env::var("MS").is_ok() {
                eprintln!("length {length} pieces {} misfit {misfit} unexplained {}", shooting.count(), self.unexplained);
            }
            if misfit <= self.unexplained || misfit.is_finite() && length <= LEAST {
                return Ok((length, shooting, x));
            }
            if length <= LEAST {
                return Err("pieces of eight samples cannot be simulated from the start; bound the parameters, or start elsewhere");
            }
            length = (length / 2).max(LEAST);
        }
    }

    /// The states of a record at some samples.
    fn nodes(&self, e: usize, at: &[usize]) -> Result<Vec<Vec<f64>>, &'static str> {
        let states = self.sizes.len();
        if let Some(filter) = &self.filter {
            let mut nodes = filter.carries(e, self.start, at).map_err(|_| "a filter fails from the start")?;
            nodes.iter_mut().for_each(|node| node.truncate(states));
            return Ok(nodes);
        }
        let (sweep, record) = (self.objective.sweep, &self.objective.problem.records[e]);
        let p = self.objective.problem.unknowns.of_experiment(e, self.start).p;
        let measured = |k: &usize| sweep.measured_state(record, *k, &p);
        let all: Result<Vec<Vec<f64>>, String> = at.iter().map(measured).collect();
        all.map_err(|_| "outputs do not give the state where pieces begin, and the model is not compiled, so that there is no filter")
    }

    /// The end of multiple shooting with these pieces.
    fn shot(&self, mut shooting: Shooting<'_>, mut x: Vec<f64>, control: &Control) -> Option<Shot> {
        let (mut evaluations, mut before, mut shot) = (0, f64::INFINITY, None);
        let (mut least, mut stuck) = (f64::INFINITY, 0);
        for round in 0..ROUNDS {
            shooting.begin_at(&x);
            let (end, count) = minimize(&shooting, x);
            x = end;
            evaluations += count;
            let passed = shooting.pass(&x).ok()?;
            let gap = passed.gaps.iter().fold(0.0, |most: f64, gap| most.max(gap.abs())) / self.part;
            let misfit = self.misfit(passed.cost);
            let coordinates = shooting.coordinates(&x);
            if std::env::var("MS").is_ok() {
                eprintln!("round {round} evaluations {count} gap {gap:.3e} misfit {misfit:.4} {:?}", &coordinates);
            }
            shot = Some(Shot { coordinates, nodes: shooting.nodes(&x), pieces: shooting.count(), evaluations, gap, misfit });
            if gap <= SHRUNK * least {
                (least, stuck) = (gap, 0);
            } else {
                stuck += 1;
            }
            if gap <= CLOSED || stuck >= tune("MS_STUCK", STUCK as f64) as usize || control.stops() {
                break;
            }
            shooting.tighten(&passed.gaps, gap <= SHRUNK * before);
            before = gap;
        }
        shot
    }
}

/// The end of a search for the least cost with fixed multipliers, and its evaluations.
fn minimize(shooting: &Shooting<'_>, start: Vec<f64>) -> (Vec<f64>, u64) {
    let stop = Stop { cost: tune("MS_COST", INNER.cost), iterations: tune("MS_TRIALS", 20.0) as u64, ..INNER };
    let mut search = LevenbergMarquardt::new(stop, OwnSize);
    search.begin(start, Domain::of(shooting));
    let mut evaluations = 0;
    loop {
        match search.request() {
            Request::Linearize(x) => {
                let answer = shooting.linearize(x);
                evaluations += 1;
                search.tell(answer);
            }
            Request::Curvature { x, along } => {
                let answer = shooting.curvature(x, along);
                search.tell_curvature(answer);
            }
            Request::Ended(outcome) => {
                if std::env::var("MS").is_ok() {
                    eprintln!("  {outcome:?}");
                }
                return (search.place().to_vec(), evaluations);
            }
        }
    }
}
