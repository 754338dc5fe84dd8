//! Minima at a kink of the cost: where a held input acts late by a whole number of samples, the slope with respect to the dead time jumps, and the cost may
//! rise on both sides. So it does with respect to a limit in a condition of a static model, such as that of a dead zone, where the limit is what a sample measured.
//! Conditions on states, such as those of dry friction, make the cost rugged: its small minima are none of the fit.

use crate::layout::Kind;
use crate::optimize::{Domain, LeastSquares, LevenbergMarquardt, Linearization, Machine, Request, Stop};
use crate::problem::{Objective, Role, Round};
use crate::scaling::OwnSize;

/// How far beside a kink slopes are taken, as a part of the unknown: searches were seen to end within 1e-8 of the kink, and over this distance the
/// slope of a smooth cost changes little, also where the plant is twenty times as fast as the dead time.
const BESIDE: f64 = 1e-6;
/// Slopes before and behind a point jump if they differ by more than so many times what the curvature of a smooth cost makes of the distance.
const JUMP: f64 = 10.0;
/// Most searches with unknowns kept at kinks: in the first one others may run into kinks of their own.
const SEARCHES: usize = 3;
/// Most trial steps of each, which begins near a minimum.
const TRIALS: u64 = 200;

/// The end of a round as a minimum, if the model has dead times, or is static with parameters in its conditions, and the cost has a kink where no step lowers it: the unknowns whose
/// slopes jump there are held, and the others searched. At the minimum that is found, the cost has to fall towards the kink from both sides. `None` where it is none.
pub(super) fn at_kink(objective: &Objective<'_>, round: &Round) -> Option<Round> {
    let values = objective.values_of(0, &round.coordinates);
    let late = !objective.sweep.late(&values.p).is_empty();
    let choosing = match objective.problem.layout().kind {
        Kind::Static => objective.sweep.choosing().unwrap_or_default(),
        Kind::Continuous | Kind::Discrete => &[],
    };
    // An initial state moves no dead time, nor a limit.
    let may_jump = |role: &Role| matches!(role, Role::Parameter(p) if late || choosing.contains(p));
    let unknowns = objective.problem.unknowns.row.iter().enumerate();
    let parameters: Vec<usize> = unknowns.filter(|(_, unknown)| may_jump(&unknown.role)).map(|(i, _)| i).collect();
    if parameters.is_empty() {
        return None;
    }
    let mut round = round.clone();
    for _ in 0..SEARCHES {
        round.evaluations += 2 * parameters.len() as u64;
        let jumps = |i: &usize| Slopes::beside(objective, &round.coordinates, *i).is_some_and(Slopes::jump);
        let kinks: Vec<usize> = parameters.iter().copied().filter(jumps).collect();
        if kinks.is_empty() {
            return None;
        }
        let mut domain = Domain::of(objective);
        kinks.iter().for_each(|i| domain.bounds[*i] = (round.coordinates[*i], round.coordinates[*i]));
        round = search(objective, round, domain);
        if round.outcome.converged() {
            round.evaluations += 2 * kinks.len() as u64;
            let lead_back =
                |i: &usize| Slopes::beside(objective, &round.coordinates, *i).is_some_and(Slopes::lead_back);
            return kinks.iter().all(lead_back).then_some(round);
        }
    }
    None
}

/// The slopes of the cost along an unknown just before a point and just behind it.
#[derive(Clone, Copy)]
struct Slopes {
    before: f64,
    behind: f64,
    /// By how much they would differ without a kink: the distance times the curvature `J'J`.
    smooth: f64,
}

impl Slopes {
    fn beside(objective: &Objective<'_>, x: &[f64], unknown: usize) -> Option<Self> {
        let far = BESIDE * if objective.logarithms()[unknown] { 1.0 } else { x[unknown].abs() };
        let at = |side: f64| {
            let mut x = x.to_vec();
            x[unknown] += side * far;
            let linear = objective.linearize(&x).ok()?;
            Some((linear.gradient()[unknown], linear.column_norms()[unknown]))
        };
        let ((before, norm), (behind, _)) = (at(-1.0)?, at(1.0)?);
        Some(Slopes { before, behind, smooth: 2.0 * far * norm * norm })
    }

    /// Whether the slope jumps upwards between the two.
    fn jump(self) -> bool {
        self.behind - self.before > JUMP * self.smooth
    }

    /// Whether the cost falls towards the point from both sides.
    fn lead_back(self) -> bool {
        self.before < 0.0 && self.behind > 0.0
    }
}

/// Goes on from where a round ended, within this domain.
fn search(objective: &Objective<'_>, round: Round, domain: Domain) -> Round {
    let trials = objective.problem.settings.optimizer.most().min(TRIALS);
    let mut machine = LevenbergMarquardt::new(Stop { iterations: trials, ..Stop::default() }, OwnSize);
    machine.begin(round.coordinates.clone(), domain);
    let (mut evaluations, mut iterations) = (round.evaluations, round.iterations);
    let outcome = loop {
        match machine.request() {
            Request::Linearize(x) => {
                machine.tell(objective.linearize(x));
                iterations += 1;
            }
            Request::Curvature { x, along } => machine.tell_curvature(objective.curvature(x, along)),
            Request::Ended(outcome) => break outcome,
        }
        evaluations += 1;
    };
    let linear: Option<Linearization> = machine.linearization().cloned();
    let outcome = objective.control.named(outcome);
    Round { coordinates: machine.place().to_vec(), linear, outcome, evaluations, iterations, ..round }
}
