use crate::{Model, Scalar};
use serde::{Deserialize, Serialize};

crate::signals! {
    /// Motion of a linear axis.
    pub struct AxisMotion {
        /// Position.
        q: "m",
        /// Speed.
        v: "m/s",
    }
    /// Motion of a linear axis, and what its controller keeps.
    pub struct ControlledAxisMotion {
        /// Position.
        q: "m",
        /// Speed.
        v: "m/s",
        /// How far it has moved since the last sample.
        moved: "m",
        /// How far it moved in the interval before.
        before: "m",
        /// Command, held until the next sample.
        held: "V",
    }
    /// Input of the axis.
    pub struct Command {
        /// Command to the drive.
        vir: "V",
    }
    /// Input of the axis under its controller.
    pub struct Reference {
        /// Position that it is to have.
        qg: "m",
    }
    /// Measured outputs of the axis.
    pub struct Position {
        /// Position.
        qm: "m",
    }
    /// Measured outputs of the axis under its controller.
    pub struct ControlledAxisOutput {
        /// Position.
        qm: "m",
        /// Command to the drive, as the controller gives it.
        vir: "V",
    }
    /// Parameters of a linear axis, referred to the load.
    pub struct AxisParameters {
        /// Mass, with the inertia of all that turns; must be positive.
        m: "kg",
        /// Viscous friction; negative is not physical.
        fv: "N s/m",
        /// Dry friction; negative is not physical.
        fc: "N",
        /// Constant force: the drive's offset, and what friction differs between the directions.
        offset: "N",
    }
}

/// A linear axis with a drive whose force follows its command (an electro-mechanical positioning system):
///
/// ```text
/// m dv/dt = gtau vir - fv v - fc tanh(v / width) - offset      dq/dt = v
/// ```
///
/// After A. Janot, M. Gautier, M. Brunot, *Data set and reference models of EMPS*, Workshop on Nonlinear System
/// Identification Benchmarks, Eindhoven 2019, whose dry friction is `fc sign(v)`. That has no slope at rest;
/// the smooth one approaches it where `|v|` is a few times `width`.
///
/// The hold of the record must be [`Hold::Zero`](crate::Hold::Zero): a drive holds its command from sample to sample, which
/// is the default of a record.
///
/// Position is the second integral of the command: in an open loop, small errors of the force grow without bound, and a
/// long simulation from poor parameters ends in wrong minima. Where the controller is known, [`PositioningLoop`] is the
/// better model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Positioning {
    /// Force per command (N/V), known beforehand: all parameters scale with it.
    pub gtau: f64,
    /// Speed (m/s) within which dry friction turns over; positive.
    pub width: f64,
}

impl Positioning {
    /// The axis of the benchmark.
    pub const EMPS: Positioning = Positioning { gtau: 35.150_651_88, width: 5e-4 };

    #[inline]
    fn acceleration<S: Scalar>(&self, v: S, vir: S, p: &AxisParameters<S>) -> S {
        (vir * self.gtau - p.fv * v - p.fc * (v / self.width).tanh() - p.offset) / p.m
    }
}

impl Model for Positioning {
    type State = AxisMotion;
    type Input = Command;
    type Output = Position;
    type Parameters = AxisParameters;

    #[inline]
    fn derivative<S: Scalar>(&self, _t: S, x: &AxisMotion<S>, u: &Command<S>, p: &AxisParameters<S>) -> AxisMotion<S> {
        AxisMotion { q: x.v, v: self.acceleration(x.v, u.vir, p) }
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &AxisMotion<S>, _u: &Command<S>, _p: &AxisParameters<S>) -> Position<S> {
        Position { qm: x.q }
    }
}

/// A [`Positioning`] axis under a digital controller of position around one of speed, which computes at each sample and holds its command
/// until the next:
///
/// ```text
/// vir = kp kv (qg - q) - kv vm,    |vir| <= limit        vm = (q[k] - q[k-2]) / 2 ts
/// ```
///
/// So it is in the record of the benchmark: the speed in `kp kv (qg - q) - vir` is, to 0.2 %, the mean of the last two differences of
/// the position. The controller is a sampled part of the model ([`Model::jump`]): the samples of a record must be its own, `ts` apart.
///
/// The controller keeps the simulated axis near the reference whatever the parameters, so that a fit finds its way from
/// far off; and the command that the model needs to do so, compared with the recorded one, determines the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PositioningLoop {
    /// The axis.
    pub axis: Positioning,
    /// Gain of the position controller (1/s).
    pub kp: f64,
    /// Gain of the speed controller (V s/m).
    pub kv: f64,
    /// Largest command (V).
    pub limit: f64,
    /// Its sampling time (s), which is that of the record; positive.
    pub ts: f64,
}

impl PositioningLoop {
    /// The axis of the benchmark under its recorded controller.
    pub const EMPS: PositioningLoop =
        PositioningLoop { axis: Positioning::EMPS, kp: 160.18, kv: 243.45, limit: 10.0, ts: 1e-3 };

    #[inline]
    fn command<S: Scalar>(&self, x: &ControlledAxisMotion<S>, u: &Reference<S>) -> S {
        let vm = (x.moved + x.before) / (2.0 * self.ts);
        (((u.qg - x.q) * self.kp - vm) * self.kv).clamp(-self.limit, self.limit)
    }
}

impl Model for PositioningLoop {
    type State = ControlledAxisMotion;
    type Input = Reference;
    type Output = ControlledAxisOutput;
    type Parameters = AxisParameters;

    #[inline]
    fn derivative<S: Scalar>(
        &self,
        _t: S,
        x: &ControlledAxisMotion<S>,
        _u: &Reference<S>,
        p: &AxisParameters<S>,
    ) -> ControlledAxisMotion<S> {
        let (v, still) = (self.axis.acceleration(x.v, x.held, p), S::from(0.0));
        ControlledAxisMotion { q: x.v, v, moved: x.v, before: still, held: still }
    }

    #[inline]
    fn jump<S: Scalar>(
        &self,
        _t: S,
        x: &ControlledAxisMotion<S>,
        u: &Reference<S>,
        _p: &AxisParameters<S>,
    ) -> ControlledAxisMotion<S> {
        ControlledAxisMotion { moved: S::from(0.0), before: x.moved, held: self.command(x, u), ..*x }
    }

    /// The command before the first sample has no effect. The movement in the last interval before it is estimated, that in the interval before taken
    /// as zero.
    #[inline]
    fn initial<S: Scalar>(&self, _u: &Reference<S>, _p: &AxisParameters<S>) -> ControlledAxisMotion<S> {
        let (still, unsaid) = (S::from(0.0), S::from(f64::NAN));
        ControlledAxisMotion { q: unsaid, v: unsaid, moved: unsaid, before: still, held: still }
    }

    #[inline]
    fn output<S: Scalar>(
        &self,
        _t: S,
        x: &ControlledAxisMotion<S>,
        u: &Reference<S>,
        _p: &AxisParameters<S>,
    ) -> ControlledAxisOutput<S> {
        ControlledAxisOutput { qm: x.q, vir: self.command(x, u) }
    }
}
