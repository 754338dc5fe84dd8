//! A model of one's own: a mug of water on a heater, cooling with and without its lid, watched through a thermistor.
//!
//! It shows a discrete model, a nonlinear output, two experiments with a start of their own each, a parameter that every
//! experiment has for itself, a prior from a data sheet, bounds, and logarithms: `cargo run --release --example own_model`.

use greybox::{Error, ExperimentOf, Fit, Kind, Model, Scalar, Time, free, signals, simulate};

signals! {
    /// What the mug remembers.
    struct Heat { temperature: "K" }
    /// What acts on it.
    struct Surroundings { power: "W", ambient: "K" }
    /// What is measured: the thermistor.
    struct Thermistor { resistance: "kohm" }
    /// Heat capacity, heat loss, and the thermistor's `r = r25 exp(beta (1/T - 1/298.15 K))`.
    struct Mug { capacity: "J/K", loss: "W/K", r25: "kohm", beta: "K" }
}

/// Newton's law of cooling, solved from one sample to the next (s).
struct Cooling {
    step: f64,
}

impl Cooling {
    fn time(&self) -> Time {
        Time::Uniform { start: 0.0, step: self.step }
    }
}

impl Model for Cooling {
    type State = Heat;
    type Input = Surroundings;
    type Output = Thermistor;
    type Parameters = Mug;
    const KIND: Kind = Kind::Discrete;

    fn next<S: Scalar>(&self, _t: S, x: &Heat<S>, u: &Surroundings<S>, p: &Mug<S>) -> Heat<S> {
        let rest = u.ambient + u.power / p.loss;
        let decay = (-p.loss * self.step / p.capacity).exp();
        Heat { temperature: rest + (x.temperature - rest) * decay }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Heat<S>, _u: &Surroundings<S>, p: &Mug<S>) -> Thermistor<S> {
        Thermistor { resistance: p.r25 * (p.beta * (x.temperature.recip() - 1.0 / 298.15)).exp() }
    }
}

fn main() -> Result<(), Error> {
    let model = Cooling { step: 10.0 };
    let open = Mug { capacity: 1250.0, loss: 1.9, r25: 10.12, beta: 3965.0 };
    let records = [
        measured(&model, "open", open, 352.0, 1)?.initial(Heat { temperature: free(340.0).within(273.0, 373.0) }),
        measured(&model, "lid on", Mug { loss: 0.8, ..open }, 294.0, 2)?.initial(Heat { temperature: free(300.0) }),
    ];
    let estimate = Fit::new(&model, &records)
        .parameters(Mug {
            capacity: free(1000.0).log(),
            loss: free(1.0).log().per_experiment(),
            r25: free(10.0).within(9.5, 10.5), // 5 %, says the data sheet
            beta: free(3950.0).prior(3950.0, 40.0),
        })
        .run()?;
    println!("{estimate}\n\nTrue values, with the lid a loss of 0.8 W/K:\n{open:?}");

    // The estimate simulated. How warm does the open mug stay at 30 W?
    let (time, inputs) = (model.time(), vec![Surroundings { power: 30.0, ambient: 293.0 }; 1000]);
    let future = simulate(&model, &estimate.parameters, &Heat { temperature: 293.0 }, time, &inputs)?;
    let last = future.outputs[999].resistance;
    println!("After three hours at 30 W the thermistor will show {last:.4} kohm.");
    Ok(())
}

/// Half an hour on a heater that is switched on and off, with noise of 20 ohm.
fn measured(
    model: &Cooling,
    name: &str,
    truth: Mug,
    temperature: f64,
    seed: u64,
) -> Result<ExperimentOf<Cooling>, Error> {
    let power = |k: usize| if (k / 60).is_multiple_of(2) { 0.0 } else { 90.0 };
    let inputs: Vec<_> = (0..180).map(|k| Surroundings { power: power(k), ambient: 293.0 }).collect();
    let run = simulate(model, &truth, &Heat { temperature }, model.time(), &inputs)?;
    Ok(run.with_noise(Thermistor { resistance: 0.02 }, seed).experiment(model)?.named(name))
}
