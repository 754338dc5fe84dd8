// PMSM with surface magnets, written by greybox from a text model.

#[allow(unused_imports)]
use greybox::{Model, Of, Scalar, signals, Parameter, free};

signals! {
    /// States.
    pub struct PmsmWithSurfaceMagnetsState {
        /// id
        id: "A",
        /// iq
        iq: "A",
    }
    /// Inputs.
    pub struct PmsmWithSurfaceMagnetsInput {
        /// voltage along the magnet flux, phase peak
        ud: "V",
        /// voltage 90 electrical degrees ahead of it
        uq: "V",
        /// mechanical speed
        w: "rad/s",
    }
    /// Outputs.
    pub struct PmsmWithSurfaceMagnetsOutput {
        /// id
        id: "A",
        /// iq
        iq: "A",
    }
    /// Parameters.
    pub struct PmsmWithSurfaceMagnetsParameters {
        /// phase resistance
        rs: "ohm",
        /// synchronous inductance
        ls: "H",
        /// line-to-line rms back-EMF per mechanical speed
        ke: "V s/rad",
    }
}

/// PMSM with surface magnets.
///
/// Currents of a permanent magnet synchronous motor in the rotor frame, phase peak; the Rust twin is pmsm::Surface.
#[derive(Clone, Debug, PartialEq)]
pub struct PmsmWithSurfaceMagnets {
    /// pole pairs (1)
    pub np: f64,
}

impl Default for PmsmWithSurfaceMagnets {
    fn default() -> Self {
        PmsmWithSurfaceMagnets {
            np: 4.0,
        }
    }
}

impl Model for PmsmWithSurfaceMagnets {
    type State = PmsmWithSurfaceMagnetsState;
    type Input = PmsmWithSurfaceMagnetsInput;
    type Output = PmsmWithSurfaceMagnetsOutput;
    type Parameters = PmsmWithSurfaceMagnetsParameters;

    #[inline]
    fn derivative<S: Scalar>(&self, _t: S, x: &Of<Self::State, S>, u: &Of<Self::Input, S>, p: &Of<Self::Parameters, S>) -> Of<Self::State, S> {
        let we = u.w * self.np;
        PmsmWithSurfaceMagnetsState {
            id: (u.ud - p.rs * x.id) / p.ls + we * x.iq,
            iq: (u.uq - p.rs * x.iq - p.ke * u.w * f64::sqrt(2.0 / 3.0)) / p.ls - we * x.id,
        }
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Of<Self::State, S>, _u: &Of<Self::Input, S>, _p: &Of<Self::Parameters, S>) -> Of<Self::Output, S> {
        PmsmWithSurfaceMagnetsOutput {
            id: x.id,
            iq: x.iq,
        }
    }
}

impl PmsmWithSurfaceMagnets {
    /// The parameters as they are declared.
    pub fn parameters() -> PmsmWithSurfaceMagnetsParameters<Parameter> {
        PmsmWithSurfaceMagnetsParameters {
            rs: free(1.0).positive(),
            ls: free(0.002).positive(),
            ke: free(0.7),
        }
    }
}
