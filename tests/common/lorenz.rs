//! A chaotic plant.

use greybox::*;

signals! { pub struct Flow { x: "1", y: "1", z: "1" } }
signals! { pub struct First { x: "1" } }
signals! { pub struct Constants { sigma: "1/s", rho: "1", beta: "1/s" } }

/// E. N. Lorenz, *Deterministic nonperiodic flow*, Journal of the Atmospheric Sciences 20 (1963) 130-141, of which `x` alone is measured.
#[derive(Clone)]
pub struct Lorenz;

impl Model for Lorenz {
    type State = Flow;
    type Input = Nothing;
    type Output = First;
    type Parameters = Constants;

    fn derivative<S: Scalar>(&self, _t: S, x: &Flow<S>, _u: &Nothing, p: &Constants<S>) -> Flow<S> {
        Flow { x: p.sigma * (x.y - x.x), y: x.x * (p.rho - x.z) - x.y, z: x.x * x.y - p.beta * x.z }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Flow<S>, _u: &Nothing, _p: &Constants<S>) -> First<S> {
        First { x: x.x }
    }
}
