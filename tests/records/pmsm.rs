//! The model of the records.

use greybox::{Model, Scalar, signals};

signals! {
    pub struct Currents { id: "A", iq: "A" }
    pub struct Drive { ud: "V", w: "rad/s" }
    pub struct Winding { rs: "ohm" }
}

/// A motor of which only names and units matter.
pub struct Pmsm;

impl Model for Pmsm {
    type State = Currents;
    type Input = Drive;
    type Output = Currents;
    type Parameters = Winding;

    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &Drive<S>, _p: &Winding<S>) -> Currents<S> {
        *x
    }
}
