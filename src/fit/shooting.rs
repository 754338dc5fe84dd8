//! Multiple shooting for far starts: the records in pieces that begin near the measurements, and continuity asked for step by step.

use super::moves::{EXPLAINS, Movement, Moves, NEAR, UNEXPLAINED};
use crate::numeral::number;
use crate::optimize::{Domain, LeastSquares, LevenbergMarquardt, Machine, Outcome, OwnSize, Request, Stop};
use crate::problem::{Control, Objective, Problem, Shooting, Whitening};
use crate::record::{Channel, Record};
use std::fmt;

/// The least samples of a piece.
const LEAST: usize = 8;
/// Pieces of half the length follow where an end is not near the noise, unless it is that of the pieces before; so many lengths are tried.
const LENGTHS: usize = 4;
/// A search with fixed multipliers ends where the next step would lower the cost by this part. Multipliers that change before, or a penalty that rises,
/// lead to other minima. After so many trial steps it goes on only if the error of the pieces is below [`UNEXPLAINED`], up to so many times.
const INNER: Stop = Stop { step: 1e-10, gradient: 1e-8, cost: 1e-4, iterations: 100 };
const PARTS: usize = 5;
/// The most searches.
const ROUNDS: usize = 40;
/// The penalty rises where the largest gap did not shrink to this part; after so many searches in which it did not, rounding is what is left.
const SHRUNK: f64 = 0.25;
const STUCK: usize = 6;
/// The last search is the one after which the largest gap is at most this part of the noise: a chaotic plant makes gaps larger by a factor of 1e8. Far
/// from the noise the last one is that which closes continuity.
const LAST: f64 = 1e-9;
/// Continuity is closed where the largest gap is at most this part of the noise.
const CLOSED: f64 = 1e-3;
/// Closed ends whose misfits differ by less than this part are one minimum.
const SAME: f64 = 1e-3;

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
        self.gap <= CLOSED && self.misfit <= EXPLAINS
    }

    /// Whether gaps stayed open, or the errors are far from the noise.
    pub fn is_lost(&self) -> bool {
        self.gap > CLOSED || self.misfit > NEAR
    }
}

impl fmt::Display for Shot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (pieces, gap, misfit) = (self.pieces, number(self.gap, 1), number(self.misfit, 2));
        write!(
            f,
            "multiple shooting ({pieces} pieces; in units of the noise, the largest gap is {gap} and the rms error {misfit})"
        )
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
    /// The sum of the weights of all measurements of outputs that move.
    weight: f64,
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
    if aim.weight == 0.0 {
        return Err("no measurement of an output that moves has a weight");
    }
    let length = (movement.rate * movement.step).recip() as usize;
    let mut length = length.clamp(LEAST, longest / 2);
    let (mut best, mut evaluations): (Option<Shot>, u64) = (None, 0);
    for _ in 0..LENGTHS {
        let found = aim.explained(length).and_then(|(explained, shooting, x)| {
            Ok((explained, aim.shot(shooting, x, control).ok_or("its first search came to no end")?))
        });
        let (explained, shot) = match found {
            Ok(found) => found,
            Err(_) if best.is_some() => break,
            Err(_) if control.stops() => return Err("a limit of the fit stopped it"),
            Err(reason) => return Err(reason),
        };
        evaluations += shot.evaluations;
        let order = |shot: &Shot| (shot.gap > CLOSED, shot.misfit);
        let closed = |shot: &Shot| (shot.gap <= CLOSED).then_some(shot.misfit);
        let again = best.as_ref().and_then(closed).zip(closed(&shot)).is_some_and(|(a, b)| (a - b).abs() < SAME * a);
        if best.as_ref().is_none_or(|best| order(&shot) < order(best)) {
            best = Some(shot);
        }
        if best.as_ref().is_some_and(Shot::explains) || again || explained == LEAST || control.stops() {
            break;
        }
        length = (explained / 2).max(LEAST);
    }
    best.map(|shot| Shot { evaluations, ..shot }).ok_or("its first search came to no end")
}

impl<'s> Aim<'s> {
    fn new(
        problem: &'s Problem<'s>,
        movement: &Movement,
        filter: Option<Objective<'s>>,
        start: &'s [f64],
        control: &'s Control,
    ) -> Option<Self> {
        // An output that does not move has no noise that errors can be compared with: it counts for nothing.
        let level = |moves: &Moves| if moves.half > 0.0 { moves.level() } else { f64::INFINITY };
        let sigma: Vec<f64> = movement.outputs.iter().map(level).collect();
        let parts = movement.outputs.iter().zip(&sigma).filter(|(moves, _)| moves.half > 0.0);
        let part = parts.clone().map(|(moves, sigma)| sigma / moves.half).fold(0.0, f64::max);
        let squares = parts.clone().map(|(moves, sigma)| (moves.half / sigma).powi(2)).sum::<f64>();
        let unexplained = UNEXPLAINED * (squares / parts.count() as f64).sqrt();
        let positive = |size: f64| if size > 0.0 { size } else { 1.0 };
        let sizes = problem.scales(&problem.records[movement.most], movement.rate)?.into_iter().map(positive).collect();
        let objective = problem.in_units(control).with(Whitening::Diagonal(sigma));
        let weight = weight(&objective, &movement.outputs);
        Some(Aim { objective, filter, start, sizes, part, unexplained, weight })
    }

    /// The root of the mean square error of the pieces.
    fn misfit(&self, cost: f64) -> f64 {
        (2.0 * cost / self.weight).sqrt()
    }

    /// Pieces that explain the outputs at the start, of at most so many samples, or the shortest ones.
    fn explained(&self, mut length: usize) -> Result<(usize, Shooting<'_>, Vec<f64>), &'static str> {
        loop {
            let penalty = self.part.powi(-2);
            let shooting = Shooting::new(&self.objective, length, self.sizes.clone(), penalty);
            let nodes = (0..self.objective.experiments()).map(|e| self.nodes(e, &shooting.nodes_at(e)));
            let nodes: Vec<Vec<Vec<f64>>> = nodes.collect::<Result<_, _>>()?;
            let x = shooting.point(self.start, &nodes);
            let misfit = shooting.pass(&x).map_or(f64::INFINITY, |passed| self.misfit(passed.cost));
            if misfit <= self.unexplained || misfit.is_finite() && length <= LEAST {
                return Ok((length, shooting, x));
            }
            if length <= LEAST {
                return Err(
                    "pieces of eight samples cannot be simulated from the start; bound the parameters, or start elsewhere",
                );
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
        all.map_err(|_| {
            "outputs do not give the state where pieces begin, and there is no filter that does (more than six states, steps of the integrator that \
             depend on the state, or a model that cannot be read as a graph)"
        })
    }

    /// Moves `x` to the least cost with fixed multipliers, and tells whether a limit of trial steps ended the search.
    fn minimized(&self, shooting: &mut Shooting<'_>, x: &mut Vec<f64>, evaluations: &mut u64) -> bool {
        for _ in 0..PARTS {
            shooting.begin_at(x);
            let (end, outcome, count) = minimize(shooting, std::mem::take(x));
            *x = end;
            *evaluations += count;
            if !matches!(outcome, Outcome::IterationLimit { .. }) {
                return false;
            }
            if !shooting.pass(x).is_ok_and(|passed| self.misfit(passed.cost) <= self.unexplained) {
                break;
            }
        }
        true
    }

    /// The end of multiple shooting with these pieces.
    fn shot(&self, mut shooting: Shooting<'_>, mut x: Vec<f64>, control: &Control) -> Option<Shot> {
        let (mut evaluations, mut before, mut shot) = (0, f64::INFINITY, None);
        let (mut least, mut stuck) = (f64::INFINITY, 0);
        for round in 1..=ROUNDS {
            let limited = self.minimized(&mut shooting, &mut x, &mut evaluations);
            if shooting.is_stopped(&x) && round < ROUNDS && !control.stops() {
                continue;
            }
            let Ok(passed) = shooting.pass(&x) else { break };
            let gap = passed.gaps.iter().fold(0.0, |most: f64, gap| most.max(gap.abs())) / self.part;
            let misfit = self.misfit(passed.cost);
            let coordinates = shooting.coordinates(&x);
            // Parameters that explain the pieces without continuity, or with it, have not come near the noise.
            let far = (limited || gap <= CLOSED) && misfit > NEAR;
            shot = Some(Shot {
                coordinates,
                nodes: shooting.nodes(&x),
                pieces: shooting.count(),
                evaluations,
                gap,
                misfit,
            });
            if gap <= SHRUNK * least {
                (least, stuck) = (gap, 0);
            } else {
                stuck += 1;
            }
            if gap <= LAST || far || stuck >= STUCK || control.stops() {
                break;
            }
            shooting.tighten(&passed.gaps, gap <= SHRUNK * before);
            before = gap;
        }
        shot
    }
}

/// The sum of the weights of all measurements of outputs that move.
fn weight(objective: &Objective<'_>, outputs: &[Moves]) -> f64 {
    let records = objective.problem.records.iter().enumerate();
    let moving = records.flat_map(|(e, record)| {
        let channels = record.outputs().iter().zip(outputs).filter(|(_, moves)| moves.half > 0.0);
        channels.map(move |(channel, _)| (e, channel))
    });
    let of = |(e, channel): (usize, &Channel)| -> f64 {
        let measured = (0..channel.values.len()).filter(|k| !channel.values[*k].is_nan());
        measured.map(|k| objective.weight(e, k)).sum()
    };
    moving.map(of).sum()
}

/// The end of a search for the least cost with fixed multipliers, its outcome, and its evaluations.
fn minimize(shooting: &Shooting<'_>, start: Vec<f64>) -> (Vec<f64>, Outcome, u64) {
    let mut search = LevenbergMarquardt::new(INNER, OwnSize);
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
            Request::Ended(outcome) => return (search.place().to_vec(), outcome, evaluations),
        }
    }
}
