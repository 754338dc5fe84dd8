//! Simulation of equations with the noise that they have.

use super::Fit;
use super::fittable::{AnyStepping, Made};
use super::simulate::{given, with_outputs};
use crate::equations::Equations;
use crate::error::{Error, Failure};
use crate::functions::delays;
use crate::integrate::Stuck;
use crate::layout::{Kind, Quantity};
use crate::predict::{Between, Intervals, Plant, SlicePlant};
use crate::random::Random;
use crate::record::Record;
use crate::simulate::Disturbance;
use crate::sweep::{Evaluated, ModelCode};

impl Fit<'_, Equations> {
    /// [`simulate`](Self::simulate) with the noise that the equations have: process noise disturbs the state
    /// ([`Model::diffusion`](crate::Model::diffusion)), as by [`Simulator::disturbed`](crate::Simulator::disturbed), and white Gaussian noise is added to the outputs
    /// ([`Model::noise`](crate::Model::noise)), of the state and the inputs at each sample. `noise` has an entry per output: a standard deviation in place of the
    /// equations'. An output of which neither says one is without. The same seed draws the same. Where no integrator was chosen, steps become finer until the
    /// disturbed outputs settle, as in [`simulate`](Self::simulate).
    ///
    /// ```
    /// # use greybox::{Fit, Time, fixed, record::{Channel, Record}, text::Model};
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let tank = Model::named("tank", "greybox = 1\n[parameters]\na = { start = 0.5 }\nq = { start = 0.2 }\n[inputs]\nu = \"1\"\n\
    ///     [states]\nx = { derivative = \"u - a*x\", diffusion = \"q\" }\n[outputs]\nx = { value = \"x\", noise = 0.1 }\n")?;
    /// let time = Time::Uniform { start: 0.0, step: 1.0 };
    /// let states = tank.equations().layout().states.clone();
    /// let inputs = Record::new(states, time, vec![Channel::new("u", "1", vec![0.0; 2000])], vec![])?;
    /// let none: [Record; 0] = [];
    /// let fit = Fit::new(&**tank.equations(), &none).parameters(vec![fixed(0.5), fixed(0.2)]);
    /// let run = fit.simulate_noisy(&[0.0], &inputs, &[None], 7)?;
    /// let variance = run.outputs()[0].values.iter().map(|x| x * x).sum::<f64>() / 2000.0;
    /// assert!((variance / 0.05 - 1.0).abs() < 0.2); // q^2 / 2a, and 0.1^2
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`simulate`](Self::simulate); a standard deviation that is negative or not finite; a state or an output that is not finite.
    pub fn simulate_noisy(
        &self,
        initial: &[f64],
        inputs: &Record,
        noise: &[Option<f64>],
        seed: u64,
    ) -> Result<Record, Error> {
        let layout = self.model.layout();
        if noise.len() != layout.outputs.len() {
            let (found, expected) = (noise.len(), layout.outputs.len());
            return Err(Error::Option(format!("{found} noise level(s) are given for {expected} output(s)")));
        }
        for (output, level) in layout.outputs.iter().zip(noise) {
            if let Some(value) = level.filter(|level| !(level.is_finite() && *level >= 0.0)) {
                let what = &output.name;
                return Err(Error::Option(format!(
                    "the noise of output `{what}` is {value}; give zero or a positive number"
                )));
            }
        }
        // The random numbers are the same for each integrator, so that the outputs converge as steps become finer.
        let outputs = self.settled(|stepping| self.disturbed(initial, inputs, noise, seed, stepping))?;
        with_outputs(layout, inputs, outputs)
    }

    /// The outputs with noise, by one integrator.
    fn disturbed(
        &self,
        initial: &[f64],
        inputs: &Record,
        noise: &[Option<f64>],
        seed: u64,
        stepping: Option<&AnyStepping>,
    ) -> Result<Vec<Vec<f64>>, Error> {
        let layout = self.model.layout();
        let zeros = vec![vec![0.0; inputs.len()]; noise.len()];
        // Checks the initial state, the parameters and the integrator.
        let problem = self.of_inputs(inputs, zeros, given(initial), stepping)?;
        let record = &problem.records[0];
        let p: Vec<f64> = self.parameters.iter().map(|parameter| parameter.start).collect();
        let code = Evaluated::new(self.model.lent().shared());
        let (method, intervals) = (AnyStepping::method(stepping), Intervals::default());
        let delays = delays(code.values(), &code.late(&p), &p);
        let mut disturbance = Disturbance::new(layout.states.len(), seed);
        let mut of_outputs: Vec<Random> = (0..noise.len() as u64).map(|j| Random::stream(seed, j)).collect();
        let mut x = initial.to_vec();
        let mut outputs = vec![Vec::with_capacity(record.len()); noise.len()];
        for k in 0..record.len() {
            let plant = SlicePlant {
                layout,
                functions: code.values(),
                duals: code.duals(),
                method: &*method,
                between: Between::new(record, k, &delays),
                p: &p,
                intervals: &intervals,
            };
            let failure = |signal: String, value: f64| {
                Error::Simulation(Failure {
                    experiment: record.name().to_owned(),
                    sample: k,
                    time: record.moment(k),
                    signal,
                    value,
                    hint: "; check the parameters, the levels of noise and the initial state",
                })
            };
            let check = |what: &str, of: &[Quantity], values: &[f64]| {
                let wrong = of.iter().zip(values).find(|(_, value)| !value.is_finite());
                wrong.map_or(Ok(()), |(of, value)| Err(failure(format!("{what} `{}`", of.name), *value)))
            };
            check("state", &layout.states, &x)?;
            let mut y = vec![0.0; noise.len()];
            plant.output(&x, &mut y);
            let mut levels = vec![f64::NAN; noise.len()];
            plant.noise(&x, &mut levels);
            for (j, level) in levels.iter().enumerate() {
                if let Some(level) = noise[j].or_else(|| self.model.says_noise(j).then_some(*level)) {
                    y[j] += level * of_outputs[j].normal();
                }
            }
            check("output", &layout.outputs, &y)?;
            outputs.iter_mut().zip(&y).for_each(|(output, y)| output.push(*y));
            if k + 1 == record.len() || layout.kind == Kind::Static {
                continue;
            }
            plant.jump(&mut x);
            let begin = x.clone();
            let n = x.len();
            plant.flow(&mut x).map_err(|Stuck| failure("the progress of the integrator".to_owned(), 0.0))?;
            if self.model.roots().diffusion.is_empty() {
                continue;
            }
            let mut levels = vec![0.0; n];
            plant.diffusion(0.0, &begin, &mut levels);
            let slopes = (layout.kind == Kind::Continuous).then(|| {
                let mut slopes = vec![0.0; n * n];
                plant.state_slopes(0.0, &begin, &mut slopes);
                slopes
            });
            let added = disturbance.draw(slopes.as_deref(), &levels, plant.length());
            x.iter_mut().zip(added).for_each(|(x, added)| *x += added);
        }
        Ok(outputs)
    }
}
