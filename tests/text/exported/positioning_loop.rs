// Linear axis under its controller, written by greybox from a text model.

#[allow(unused_imports)]
use greybox::{Model, Of, Scalar, signals, Parameter, free};

signals! {
    /// States.
    pub struct LinearAxisUnderItsControllerState {
        /// q
        q: "m",
        /// v
        v: "m/s",
        /// since the last sample
        moved: "m",
        /// in the interval before
        before: "m",
        /// command, until the next sample
        held: "V",
    }
    /// Inputs.
    pub struct LinearAxisUnderItsControllerInput {
        /// position that it is to have
        qg: "m",
    }
    /// Outputs.
    pub struct LinearAxisUnderItsControllerOutput {
        /// position
        qm: "m",
        /// command to the drive
        vir: "V",
    }
    /// Parameters.
    pub struct LinearAxisUnderItsControllerParameters {
        /// mass, with the inertia of all that turns
        m: "kg",
        /// viscous friction
        fv: "N s/m",
        /// dry friction
        fc: "N",
        /// constant force
        offset: "N",
    }
}

/// Linear axis under its controller.
///
/// Position and command of a linear axis under a position and speed controller; the Rust twin is models::PositioningLoop.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearAxisUnderItsController {
    /// force per command (N/V)
    pub gtau: f64,
    /// speed within which dry friction turns over (m/s)
    pub width: f64,
    /// gain of the position controller (1/s)
    pub kp: f64,
    /// gain of the speed controller (V s/m)
    pub kv: f64,
    /// largest command (V)
    pub limit: f64,
    /// sampling time of the controller, which is that of the record (s)
    pub ts: f64,
}

impl Default for LinearAxisUnderItsController {
    fn default() -> Self {
        LinearAxisUnderItsController {
            gtau: 35.15065188,
            width: 0.0005,
            kp: 160.18,
            kv: 243.45,
            limit: 10.0,
            ts: 0.001,
        }
    }
}

impl Model for LinearAxisUnderItsController {
    type State = LinearAxisUnderItsControllerState;
    type Input = LinearAxisUnderItsControllerInput;
    type Output = LinearAxisUnderItsControllerOutput;
    type Parameters = LinearAxisUnderItsControllerParameters;

    #[inline]
    fn derivative<S: Scalar>(&self, _t: S, x: &Of<Self::State, S>, _u: &Of<Self::Input, S>, p: &Of<Self::Parameters, S>) -> Of<Self::State, S> {
        LinearAxisUnderItsControllerState {
            q: x.v,
            v: (x.held * self.gtau - p.fv * x.v - p.fc * (x.v / self.width).tanh() - p.offset) / p.m,
            moved: x.v,
            before: S::from(0.0),
            held: S::from(0.0),
        }
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Of<Self::State, S>, u: &Of<Self::Input, S>, _p: &Of<Self::Parameters, S>) -> Of<Self::Output, S> {
        let vm = (x.moved + x.before) / (2.0 * self.ts);
        let vir = (((u.qg - x.q) * self.kp - vm) * self.kv).clamp(-self.limit, self.limit);
        LinearAxisUnderItsControllerOutput {
            qm: x.q,
            vir: vir,
        }
    }

    #[inline]
    fn jump<S: Scalar>(&self, _t: S, x: &Of<Self::State, S>, u: &Of<Self::Input, S>, _p: &Of<Self::Parameters, S>) -> Of<Self::State, S> {
        let vm = (x.moved + x.before) / (2.0 * self.ts);
        let vir = (((u.qg - x.q) * self.kp - vm) * self.kv).clamp(-self.limit, self.limit);
        LinearAxisUnderItsControllerState {
            q: x.q,
            v: x.v,
            moved: S::from(0.0),
            before: x.moved,
            held: vir,
        }
    }

    #[inline]
    fn initial<S: Scalar>(&self, _u: &Of<Self::Input, S>, _p: &Of<Self::Parameters, S>) -> Of<Self::State, S> {
        LinearAxisUnderItsControllerState {
            q: S::from(f64::NAN),
            v: S::from(f64::NAN),
            moved: S::from(f64::NAN),
            before: S::from(0.0),
            held: S::from(0.0),
        }
    }
}

impl LinearAxisUnderItsController {
    /// The parameters as they are declared.
    pub fn parameters() -> LinearAxisUnderItsControllerParameters<Parameter> {
        LinearAxisUnderItsControllerParameters {
            m: free(100.0).positive(),
            fv: free(200.0),
            fc: free(20.0),
            offset: free(0.0),
        }
    }
}
