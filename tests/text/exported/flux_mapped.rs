// PMSM with a flux map, written by greybox from a text model.

#[allow(unused_imports)]
use greybox::{Model, Of, Scalar, signals, Parameter, Table, free};
use greybox::scalar::{Extrapolation, Interpolation};

signals! {
    /// States.
    pub struct PmsmWithAFluxMapState {
        /// id
        id: "A",
        /// iq
        iq: "A",
    }
    /// Inputs.
    pub struct PmsmWithAFluxMapInput {
        /// voltage along the magnet flux, phase peak
        ud: "V",
        /// voltage 90 electrical degrees ahead of it
        uq: "V",
        /// mechanical speed
        w: "rad/s",
    }
    /// Outputs.
    pub struct PmsmWithAFluxMapOutput {
        /// id
        id: "A",
        /// iq
        iq: "A",
    }
    /// Parameters.
    pub struct PmsmWithAFluxMapParameters {
        /// phase resistance
        rs: "ohm",
        /// line-to-line rms back-EMF per mechanical speed
        ke: "V s/rad",
        /// by which the maps are multiplied
        flux: "1",
    }
}

/// PMSM with a flux map.
///
/// A motor whose flux linkages are tables over id (x) and iq (y), those of an example: put in your own. The Rust twin is pmsm::FluxMapped.
#[derive(Clone, Debug, PartialEq)]
pub struct PmsmWithAFluxMap {
    /// pole pairs (1)
    pub np: f64,
    /// map_d (Wb)
    pub map_d: Table,
    /// map_q (Wb)
    pub map_q: Table,
}

impl Default for PmsmWithAFluxMap {
    fn default() -> Self {
        PmsmWithAFluxMap {
            np: 4.0,
            map_d: Table::surface(&[-40.0, 0.0, 40.0], &[-40.0, -20.0, 0.0, 20.0, 40.0], &[-0.16, -0.16, -0.16, -0.16, -0.16, 0.0, 0.0, 0.0, 0.0, 0.0, 0.16, 0.16, 0.16, 0.16, 0.16], Interpolation::Smooth, Extrapolation::Linear).expect("the points rise"),
            map_q: Table::surface(&[-40.0, 0.0, 40.0], &[-40.0, -20.0, 0.0, 20.0, 40.0], &[-0.10122, -0.067474, 0.0, 0.067474, 0.10122, -0.10122, -0.067474, 0.0, 0.067474, 0.10122, -0.10122, -0.067474, 0.0, 0.067474, 0.10122], Interpolation::Smooth, Extrapolation::Linear).expect("the points rise"),
        }
    }
}

impl Model for PmsmWithAFluxMap {
    type State = PmsmWithAFluxMapState;
    type Input = PmsmWithAFluxMapInput;
    type Output = PmsmWithAFluxMapOutput;
    type Parameters = PmsmWithAFluxMapParameters;

    #[inline]
    fn derivative<S: Scalar>(&self, _t: S, x: &Of<Self::State, S>, u: &Of<Self::Input, S>, p: &Of<Self::Parameters, S>) -> Of<Self::State, S> {
        let we = u.w * self.np;
        let psi_d = p.ke * f64::sqrt(2.0 / 3.0) / self.np + p.flux * self.map_d.at2(x.id, x.iq);
        let psi_q = p.flux * self.map_q.at2(x.id, x.iq);
        let dd = S::look_up(&self.map_d.grid(), [x.id, x.iq], [1, 0]);
        let dq = S::look_up(&self.map_d.grid(), [x.id, x.iq], [0, 1]);
        let qd = S::look_up(&self.map_q.grid(), [x.id, x.iq], [1, 0]);
        let qq = S::look_up(&self.map_q.grid(), [x.id, x.iq], [0, 1]);
        let vd = u.ud - p.rs * x.id + we * psi_q;
        let vq = u.uq - p.rs * x.iq - we * psi_d;
        let determinant = (dd * qq - dq * qd) * p.flux;
        PmsmWithAFluxMapState {
            id: (qq * vd - dq * vq) / determinant,
            iq: (dd * vq - qd * vd) / determinant,
        }
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Of<Self::State, S>, _u: &Of<Self::Input, S>, _p: &Of<Self::Parameters, S>) -> Of<Self::Output, S> {
        PmsmWithAFluxMapOutput {
            id: x.id,
            iq: x.iq,
        }
    }
}

impl PmsmWithAFluxMap {
    /// The parameters as they are declared.
    pub fn parameters() -> PmsmWithAFluxMapParameters<Parameter> {
        PmsmWithAFluxMapParameters {
            rs: free(1.0).positive(),
            ke: free(0.7),
            flux: free(1.0).positive(),
        }
    }
}
