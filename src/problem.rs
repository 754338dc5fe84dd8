//! [`Problem`]: model, records and settings of a fit, with quantities by position and name instead of by type.

mod absorb;
mod as_argmin;
mod batches;
mod borders;
mod by_output;
mod checkpoint;
mod control;
mod curvature;
mod finer;
mod fingerprint;
mod forgetting;
mod job;
mod likelihood;
mod linearize;
pub(crate) mod noise;
mod objective;
mod pass;
mod repeated;
mod search;
mod segments;
mod settings;
mod shooting;
mod simulate;
mod standardize;
mod states;
mod together;
mod unknowns;
mod weighing;
mod whitening;

pub(crate) use batches::each;
pub(crate) use checkpoint::CheckpointFile;
pub(crate) use control::Control;
pub(crate) use curvature::{Bend, curvatures_together};
pub(crate) use finer::{Finer, FinerSweeps, PARTS, SUBSTEPS};
pub(crate) use fingerprint::Fingerprint;
pub use objective::Objective;
pub(crate) use pass::{Accumulate, AccumulateLanes};
pub use search::Search;
pub(crate) use search::{Optimizer, Round, RoundError};
use segments::Cuts;
pub(crate) use segments::Memory;
pub(crate) use settings::{Lead, Observer, SearchPlan, Settings, Weights};
pub(crate) use shooting::Shooting;
pub use simulate::Simulated;
pub(crate) use together::{At, Slopes, gather_together, gather_together_beside, linearize_together};
pub use unknowns::Role;
pub(crate) use unknowns::{Free, Unknowns, Values};
pub(crate) use weighing::Weighing;
pub(crate) use whitening::{Noise, Whitening};

use crate::error::Error;
use crate::layout::{Kind, Layout, Quantity};
use crate::loss::expected_slope;
use crate::parameter::Parameter;
use crate::record::{Channel, Record, Time};
use crate::sweep::{Prepared, Sweep};
use std::sync::Arc;

/// A model, records and settings, ready to be fitted, without the types of the model.
///
/// It owns its records and settings, and can be moved to a thread. `'a` is the lifetime of what its sweep borrows: nothing, so `'static`,
/// where it comes from [`Fit::problem`](crate::Fit::problem) of a model that borrows nothing itself.
#[derive(Clone)]
pub struct Problem<'a> {
    pub(crate) sweep: Arc<dyn Sweep + 'a>,
    pub(crate) records: Vec<Record>,
    pub(crate) prepared: Vec<Prepared>,
    pub(crate) unknowns: Arc<Unknowns>,
    pub(crate) settings: Settings,
    /// Whether noise was asked for that a predictor of variances leaves out.
    pub(crate) leaves_noise_out: bool,
    /// Mean of `psi(z) z` for Gaussian `z`; needed where variances are predicted, one for least squares.
    pub(crate) kappa: f64,
    pub(crate) cuts: Cuts,
    /// Number of the method among those of a default fit: that which it begins with, or that was chosen, is 0.
    pub(crate) method: usize,
    /// Steps per sample of the method, if it follows the default one and does not choose them; else one.
    pub(crate) steps: usize,
    /// Whether the method was chosen by the library, which then answers for its step.
    pub(crate) refines: bool,
    pub(crate) finer: Option<Arc<dyn Finer + 'a>>,
}

impl<'a> Problem<'a> {
    /// Checks parameters and settings, and prepares every record.
    ///
    /// # Errors
    /// No record, a record or parameters that do not fit the model, nothing free, an output that was never measured, settings out
    /// of range, a value per experiment where there is one experiment ([`Error`] names which).
    pub(crate) fn new(
        sweep: Arc<dyn Sweep + 'a>,
        records: Vec<Record>,
        parameters: &[Parameter],
        settings: Settings,
    ) -> Result<Self, Error> {
        let problem = Problem::unchecked(sweep, records, parameters, settings)?;
        unknowns::check_own(problem.layout(), parameters, problem.records.len())?;
        if problem.unknowns.row.is_empty() {
            return Err(Error::NothingFree);
        }
        problem.check_measured()?;
        Ok(problem)
    }

    /// A problem without the check that something is free and that all outputs were measured.
    pub(crate) fn unchecked(
        sweep: Arc<dyn Sweep + 'a>,
        records: Vec<Record>,
        parameters: &[Parameter],
        settings: Settings,
    ) -> Result<Self, Error> {
        if records.is_empty() {
            return Err(Error::NoExperiment);
        }
        unknowns::check_count(sweep.layout(), parameters)?;
        records.iter().try_for_each(|record| check_signals(sweep.layout(), record))?;
        if sweep.layout().kind == Kind::Discrete {
            records.iter().try_for_each(check_steps)?;
        }
        settings.check(sweep.layout(), &records)?;
        let parameters = &unknowns::with_scales(&*sweep, parameters);
        let unknowns = Arc::new(Unknowns::new(&*sweep, &records, parameters)?);
        let prepared = Problem::prepared(&*sweep, &records, parameters)?;
        unknowns.check_starts(&*sweep, &records)?;
        let estimated = matches!(settings.noise, Noise::PerOutput | Noise::Predicted);
        let leaves_noise_out = sweep.predicts_variance() && !estimated;
        let settings = settings.of(&*sweep);
        let kappa = match &settings.loss {
            Some(loss) if sweep.predicts_variance() => expected_slope(&**loss),
            _ => 1.0,
        };
        let cuts = Cuts::new(&*sweep, &records, settings.prefilter.is_some());
        let (method, steps, refines, finer) = (0, 1, false, None);
        Ok(Problem {
            sweep,
            records,
            prepared,
            unknowns,
            settings,
            leaves_noise_out,
            kappa,
            cuts,
            method,
            steps,
            refines,
            finer,
        })
    }

    fn prepared(sweep: &dyn Sweep, records: &[Record], parameters: &[Parameter]) -> Result<Vec<Prepared>, Error> {
        let start: Vec<f64> = parameters.iter().map(|p| p.start).collect();
        records.iter().map(|record| sweep.prepare(record, &start)).collect()
    }

    /// This problem with other measurements of its experiments.
    pub(crate) fn with_records(&self, records: Vec<Record>) -> Result<Self, Error> {
        let prepared = Problem::prepared(&*self.sweep, &records, &self.unknowns.parameters)?;
        Ok(Problem { records, prepared, finer: None, ..self.clone() })
    }

    /// Every output must have been measured at least once.
    pub(crate) fn check_measured(&self) -> Result<(), Error> {
        for (j, output) in self.layout().outputs.iter().enumerate() {
            let measured = |record: &Record| record.outputs()[j].values.iter().any(|y| !y.is_nan());
            if !self.records.iter().any(measured) {
                let names: Vec<&str> = self.records.iter().map(|record| record.name()).collect();
                return Err(Error::OutputMissing { experiment: names.join("`, `"), output: output.name.clone() });
            }
        }
        Ok(())
    }

    /// The model's quantities.
    pub fn layout(&self) -> &Layout {
        self.sweep.layout()
    }

    /// The records.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// The samples of all records.
    pub(crate) fn samples(&self) -> usize {
        self.records.iter().map(Record::len).sum()
    }

    /// The declaration of each parameter.
    pub fn parameters(&self) -> &[Parameter] {
        &self.unknowns.parameters
    }

    /// The point where the search starts, for [`estimate`](Self::estimate): a coordinate for each unknown, of an unknown that is
    /// estimated as a logarithm that.
    pub fn start(&self) -> Vec<f64> {
        self.unknowns.start()
    }

    /// The names of the unknowns, in order.
    pub fn unknowns(&self) -> Vec<String> {
        self.unknowns.row.iter().map(|unknown| unknown.name.clone()).collect()
    }

    /// The cost to minimize, with errors in the units of the outputs.
    pub(crate) fn in_units<'p>(&'p self, control: &'p Control) -> Objective<'p> {
        let whitening = Whitening::none(self.layout().outputs.len());
        Objective::new(self, &*self.sweep, whitening, control)
    }
}

/// A discrete model steps from sample to sample, so that each has an instant of its own.
fn check_steps(record: &Record) -> Result<(), Error> {
    let Time::Stamps(stamps) = record.times() else { return Ok(()) };
    match stamps.windows(2).position(|pair| pair[0] == pair[1]) {
        Some(k) => Err(Error::Option(format!(
            "experiment `{}`: samples {k} and {} are at one instant, between which a discrete model would step; keep one of them, or              their mean",
            record.name(),
            k + 1
        ))),
        None => Ok(()),
    }
}

/// A record has the states and signals of the layout, in its order.
fn check_signals(layout: &Layout, record: &Record) -> Result<(), Error> {
    let quantities = |all: &[Quantity]| all.iter().map(|one| one.name.clone()).collect::<Vec<_>>();
    let channels = |all: &[Channel]| all.iter().map(|one| one.name.clone()).collect::<Vec<_>>();
    let roles = [
        ("states", quantities(&layout.states), quantities(&record.states)),
        ("inputs", quantities(&layout.inputs), channels(record.inputs())),
        ("outputs", quantities(&layout.outputs), channels(record.outputs())),
    ];
    let listed =
        |names: &[String]| if names.is_empty() { "none".to_owned() } else { format!("`{}`", names.join("`, `")) };
    match roles.iter().find(|(_, expected, found)| expected != found) {
        None => Ok(()),
        Some((role, expected, found)) => Err(Error::Option(format!(
            "the {role} of experiment `{}` are {}, those of the model are {}; give the model's, in its order",
            record.name(),
            listed(found),
            listed(expected)
        ))),
    }
}
