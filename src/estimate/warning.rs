//! [`Warning`]: something the reader of an estimate must know.

use crate::severity::Severity;
use serde::{Deserialize, Serialize};

#[cfg(doc)]
use super::Summary;

/// Something the reader of an estimate must know.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Warning {
    /// The kind of warning, for programs: the words of `text` may change, the code does not.
    pub code: WarningCode,
    /// How bad it is.
    pub severity: Severity,
    /// What of the estimate it is about.
    pub about: About,
    /// The warning in words, with the numbers and the remedy.
    pub text: String,
}

impl Warning {
    /// About the estimate as a whole.
    pub(crate) fn new(code: WarningCode, severity: Severity, text: String) -> Self {
        Warning { code, severity, about: About::Estimate, text }
    }

    /// About this instead.
    pub(crate) fn about(self, about: About) -> Self {
        Warning { about, ..self }
    }
}

/// What of an estimate a [`Warning`] is about. Numbers are places in the lists of a [`Summary`] and of its layout, from zero on; in
/// JSON `"step"`, or `{"unknown": 0}`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum About {
    /// The estimate as a whole, or several of its quantities.
    Estimate,
    /// One of [`Summary::unknowns`].
    Unknown(usize),
    /// One of [`Summary::outputs`].
    Output(usize),
    /// One of the model's inputs.
    Input(usize),
    /// One of [`Summary::experiments`].
    Experiment(usize),
    /// One of [`Summary::directions`].
    Direction(usize),
    /// The step of the integrator, with which the estimate is another one.
    Step,
    /// The search: how it ended, and what it went on to.
    Search,
    /// The frequency of an oscillation, which the samples do not tell from another one.
    Frequency,
    /// Other minima: of other starts, other steps or other frequencies.
    Minimum,
}

/// The subject of a [`Warning`]; in JSON in small letters with underscores (`held_at_bound`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum WarningCode {
    /// No more measurements than unknowns.
    TooFewMeasurements,
    /// The data determine none of the parameters, or, of a fit without any, none of the unknowns.
    NothingDetermined,
    /// An output that never moves.
    ConstantOutput,
    /// An input that never moves.
    ConstantInput,
    /// One exact value far away from all others, which stands for a missing measurement.
    Sentinel,
    /// An output that stops at a limit.
    Clipped,
    /// An output that stands still where the model moves.
    Frozen,
    /// An output that holds each value for several samples.
    HeldOutput,
    /// A block of an output, or a whole record, that occurs twice.
    Repeated,
    /// A column that is a copy of another one.
    IdenticalColumns,
    /// An output of few values.
    CoarseOutput,
    /// Most of an output was not measured.
    MissingMeasurements,
    /// An output that the model explains no better than its mean does.
    Unexplained,
    /// Errors of another size than the given noise.
    GivenNoise,
    /// Parameters that cannot be told from zero, or whose logarithm is known to a factor only.
    HoldsZero,
    /// A standard error that is zero or not finite.
    NoStandardError,
    /// A parameter of the opposite sign than its start.
    SignChanged,
    /// A parameter of another order of magnitude than its start.
    FarFromStart,
    /// Errors that follow from the prediction, or from an input.
    WrongShape,
    /// Parameters that differ from record to record.
    RecordsContradict,
    /// Parameters that differ from output to output.
    OutputsContradict,
    /// An output that has a gain, an offset or a delay that the model does not have.
    SensorContradicts,
    /// Parameters that differ from the first half of the data to the second.
    HalvesContradict,
    /// A predicted variance goes to zero, and the likelihood to infinity.
    UnboundedLikelihood,
    /// Errors far beyond the others under a squared loss.
    Outliers,
    /// An initial state that neither the user nor the outputs give a start for.
    GuessedStart,
    /// The search began at the end of stages ([`Fit::staged`](crate::Fit::staged)) or of multiple shooting
    /// ([`Fit::multiple_shooting`](crate::Fit::multiple_shooting)), which were asked for, or taken since the declared start cannot be simulated; or why
    /// it did not; or the parameters are those of pieces, since no simulation of a whole record follows the measurements; or a lower minimum may lie elsewhere, since a simulation from the declared start is far off and
    /// the errors are colored.
    Staged,
    /// Time jumps within a record.
    TimeGaps,
    /// An unknown is held at a bound.
    HeldAtBound,
    /// A prior that the data contradict.
    PriorContradicts,
    /// A parameter that was declared positive is not.
    NotPositive,
    /// The model bends so much within an interval that it should be asymmetric.
    CurvedInterval,
    /// One or two measurements decide an interval.
    DecidedByFew,
    /// Errors that are larger, or smaller, where an unknown is determined.
    UnevenErrors,
    /// A robust loss with so few errors within its constant that its mean curvature is uncertain.
    NarrowLoss,
    /// Noise in the measured states from which predictions restart.
    RestartNoise,
    /// Noise declared for the inputs, or of measurements that weights follow, which biases the estimate.
    InputNoise,
    /// An input that acts a sample earlier or later than the record says, or behaves otherwise between its samples.
    InputTiming,
    /// Unknowns that the data cannot tell apart.
    Unidentified,
    /// A finer step would move an unknown.
    CoarseStep,
    /// A filter of second order would move an unknown of a fit by the extended one.
    FilterOrder,
    /// A term that the likelihood asks for in an equation that process noise acts on.
    MissingTerm,
    /// Parameters of a filter with which a simulation is far worse than the predictions.
    SimulatesWorse,
    /// An oscillation with fewer than 2.5 samples a period, so that one of another frequency gives the same samples.
    Aliased,
    /// Intervals of a search that did not end at a minimum.
    NotAtMinimum,
    /// The time limit was over, or the fit cancelled, before all tests of the estimate had been made.
    NotExamined,
    /// One of several starts led to the estimate.
    MinimumFoundOnce,
    /// Another minimum explains the data as well.
    RivalMinimum,
    /// The declared start leads to another minimum.
    DeclaredStartElsewhere,
    /// The checkpoint could not be written.
    CheckpointNotWritten,
    /// The errors are autocorrelated.
    ColoredErrors,
    /// The errors of two outputs are correlated with each other.
    CorrelatedOutputs,
}
