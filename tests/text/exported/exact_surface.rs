// PMSM with surface magnets, in exact steps, written by greybox from a text model.

#[allow(unused_imports)]
use greybox::{Model, Of, Scalar, signals, Kind, Parameter, free};
use greybox::scalar::Comparison;

signals! {
    /// States.
    pub struct PmsmWithSurfaceMagnetsInExactStepsState {
        /// id
        id: "A",
        /// iq
        iq: "A",
    }
    /// Inputs.
    pub struct PmsmWithSurfaceMagnetsInExactStepsInput {
        /// voltage along the magnet flux, phase peak
        ud: "V",
        /// voltage 90 electrical degrees ahead of it
        uq: "V",
        /// mechanical speed
        w: "rad/s",
    }
    /// Outputs.
    pub struct PmsmWithSurfaceMagnetsInExactStepsOutput {
        /// id
        id: "A",
        /// iq
        iq: "A",
    }
    /// Parameters.
    pub struct PmsmWithSurfaceMagnetsInExactStepsParameters {
        /// phase resistance
        rs: "ohm",
        /// synchronous inductance
        ls: "H",
        /// line-to-line rms back-EMF per mechanical speed
        ke: "V s/rad",
    }
}

/// PMSM with surface magnets, in exact steps.
///
/// The currents one sample later, the voltage held in the frame of the stator; the Rust twin is pmsm::ExactSurface.
#[derive(Clone, Debug, PartialEq)]
pub struct PmsmWithSurfaceMagnetsInExactSteps {
    /// pole pairs (1)
    pub np: f64,
    /// sample time (s)
    pub ts: f64,
}

impl Default for PmsmWithSurfaceMagnetsInExactSteps {
    fn default() -> Self {
        PmsmWithSurfaceMagnetsInExactSteps {
            np: 4.0,
            ts: 0.0001,
        }
    }
}

impl Model for PmsmWithSurfaceMagnetsInExactSteps {
    type State = PmsmWithSurfaceMagnetsInExactStepsState;
    type Input = PmsmWithSurfaceMagnetsInExactStepsInput;
    type Output = PmsmWithSurfaceMagnetsInExactStepsOutput;
    type Parameters = PmsmWithSurfaceMagnetsInExactStepsParameters;
    const KIND: Kind = Kind::Discrete;

    #[inline]
    fn next<S: Scalar>(&self, _t: S, x: &Of<Self::State, S>, u: &Of<Self::Input, S>, p: &Of<Self::Parameters, S>) -> Of<Self::State, S> {
        let we = u.w * self.np;
        let a = p.rs * (S::from(1.0) / p.ls);
        let s = (we * (self.ts * 0.5)).sin();
        let c = (we * (self.ts * 0.5)).cos();
        let the_x = a * self.ts;
        let decay = (-the_x).exp();
        let e_re = decay * (c * c - s * s);
        let e_im = -(decay * s * c) * 2.0;
        let square = a * a + we * we;
        let g_re = S::select(Comparison::Less, S::from(0.0), square, ((S::from(1.0) - e_re) * a - e_im * we) * (S::from(1.0) / square), S::from(self.ts));
        let g_im = S::select(Comparison::Less, S::from(0.0), square, (-e_im * a - (S::from(1.0) - e_re) * we) * (S::from(1.0) / square), S::from(0.0));
        let phi = S::select(Comparison::Less, the_x.abs(), S::from(0.001), -the_x * (-the_x * (-the_x * (1.0 / 24.0) + 1.0 / 6.0) + 0.5) + 1.0, (S::from(1.0) - decay) / the_x);
        let v_re = phi * c * self.ts;
        let v_im = -(phi * s * self.ts);
        let vd = u.ud * (S::from(1.0) / p.ls);
        let vq = u.uq * (S::from(1.0) / p.ls);
        let emf = p.ke * u.w * (S::from(1.0) / p.ls) * f64::sqrt(2.0 / 3.0);
        PmsmWithSurfaceMagnetsInExactStepsState {
            id: e_re * x.id - e_im * x.iq + v_re * vd - v_im * vq + emf * g_im,
            iq: e_re * x.iq + e_im * x.id + v_re * vq + v_im * vd - emf * g_re,
        }
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Of<Self::State, S>, _u: &Of<Self::Input, S>, _p: &Of<Self::Parameters, S>) -> Of<Self::Output, S> {
        PmsmWithSurfaceMagnetsInExactStepsOutput {
            id: x.id,
            iq: x.iq,
        }
    }
}

impl PmsmWithSurfaceMagnetsInExactSteps {
    /// The parameters as they are declared.
    pub fn parameters() -> PmsmWithSurfaceMagnetsInExactStepsParameters<Parameter> {
        PmsmWithSurfaceMagnetsInExactStepsParameters {
            rs: free(1.0).positive(),
            ls: free(0.002).positive(),
            ke: free(0.7),
        }
    }
}
