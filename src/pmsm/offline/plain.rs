use super::{Equations, Span, Spans};
use crate::pmsm::frames::{rotate_into, rotate_out_of};
use crate::pmsm::{SQRT_2_3, Winding};
use serde::{Deserialize, Serialize};

/// Which voltage equations are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Axes {
    /// Only the q axis. With id = 0 it hardly determines the inductance: `diq/dt` is short.
    Q,
    /// Both; the d axis contains `we ls iq`, which determines the inductance.
    Both,
}

/// How an interval's voltage and its currents are related.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Form {
    /// Voltage held in the rotor's frame: mean current, difference of the currents.
    Rotor,
    /// The same with the voltage divided by `sinc(we Ts/2)`, the mean of a voltage that stands still while the rotor turns:
    /// corrects Ke, and only Ke.
    Sinc,
    /// Exact for a voltage held in the stationary frame, but for terms of `R/L Ts`: with `x = we Ts/2`,
    /// `u = R (i1 e^{jx} + i0 e^{-jx})/2 + L (i1 e^{jx} - i0 e^{-jx})/Ts + j sqrt(2/3) Ke w sinc x`.
    Stationary,
}

/// `sin(x)/x`.
pub(super) fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-4 { 1.0 - x * x / 6.0 } else { x.sin() / x }
}

impl Spans {
    /// The voltage equations of a surface-magnet motor (thesis 5.2.1), rows `[iq, diq/dt + we id, sqrt(2/3) w]` and
    /// `[id, did/dt - we iq, 0]` for `[rs, ls, ke]`.
    pub fn plain(&self, axes: Axes, form: Form) -> Equations<Winding> {
        let q = Equations::new().stream(self.spans.iter().map(|span| rows(self, span, form).1));
        match axes {
            Axes::Q => q,
            Axes::Both => q.stream(self.spans.iter().map(|span| rows(self, span, form).0)),
        }
    }
}

type Row = (Winding, f64);

fn rows(spans: &Spans, span: &Span, form: Form) -> (Row, Row) {
    let we = spans.pole_pairs.electrical(span.w);
    let x = 0.5 * we * spans.ts;
    let emf = SQRT_2_3 * span.w;
    let (i0, i1) = ((span.i0.id, span.i0.iq), (span.i1.id, span.i1.iq));
    // The currents at the ends seen from the rotor at mid-interval, where the stationary form has them.
    let (i0, i1, turning, back, emf) = match form {
        Form::Rotor => (i0, i1, we, 1.0, emf),
        Form::Sinc => (i0, i1, we, sinc(x), emf),
        Form::Stationary => (rotate_into(i0, x), rotate_out_of(i1, x), 0.0, 1.0, emf * sinc(x)),
    };
    let mean = (0.5 * (i0.0 + i1.0), 0.5 * (i0.1 + i1.1));
    let slope = ((i1.0 - i0.0) / spans.ts, (i1.1 - i0.1) / spans.ts);
    (
        (Winding { rs: mean.0, ls: slope.0 - turning * mean.1, ke: 0.0 }, span.ud / back),
        (Winding { rs: mean.1, ls: slope.1 + turning * mean.0, ke: emf }, span.uq / back),
    )
}
