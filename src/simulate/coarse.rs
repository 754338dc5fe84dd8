//! [`Coarse`]: whether the default step is far too long for a simulation.

use super::failed;
use crate::error::Error;
use crate::record::Time;
use crate::signals::{Of, Signals};
use core::marker::PhantomData;

/// Largest part of a state's largest value by which two steps may differ from one: an error of a tenth is seen in any plot. One step is off by that at 1.74
/// time constants, and unstable from 2.79 on.
const APART: f64 = 0.1;

/// The largest difference of each state, over all samples of a simulation, between one step and two from the same state.
pub(super) struct Coarse<S> {
    states: Vec<State>,
    of: PhantomData<S>,
}

#[derive(Clone, Copy, Default)]
struct State {
    largest: f64,
    difference: f64,
    /// The sample where it is the largest, and the state there.
    sample: usize,
    value: f64,
}

impl<S: Signals> Coarse<S> {
    pub fn new() -> Self {
        Coarse { states: vec![State::default(); S::LEN], of: PhantomData }
    }

    /// Adds the state at a sample by one step and by two.
    pub fn compare(&mut self, sample: usize, one: &Of<S, f64>, two: &Of<S, f64>) {
        let (one, two) = (S::into_array(*one), S::into_array(*two));
        for (state, (one, two)) in self.states.iter_mut().zip(one.as_ref().iter().zip(two.as_ref())) {
            let difference = (one - two).abs();
            state.largest = state.largest.max(one.abs()).max(two.abs());
            // What is no number differs.
            if difference > state.difference || difference.is_nan() {
                *state = State { difference, sample, value: *one, ..*state };
            }
        }
    }

    /// An error if a state differs by more than a tenth of its largest value.
    pub fn check(&self, time: &Time) -> Result<(), Error> {
        let hint = "; with two steps in place of one it differs by more than a tenth of its largest value: choose another integrator, Rk45 \
                    or, for a model with a fast mode, Esdirk";
        let coarse = |state: &State| state.difference.is_nan() || state.difference > APART * state.largest;
        match self.states.iter().position(coarse) {
            Some(i) => {
                let State { sample, value, .. } = self.states[i];
                Err(failed(format!("state `{}`", S::NAMES[i]), value, sample, time, hint))
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::tests::{Current, Decay, Rate, Voltage};
    use crate::{Error, Rk4, Simulator, Time};

    /// From one, a step of `z = a h` gives `1 - z + z^2/2 - z^3/6 + z^4/24`: at 1 this is 0.375 where two steps give 0.3682, at 2 it is 0.333 and 0.141.
    /// One that was chosen is kept, and a state that is zero throughout differs by nothing.
    #[test]
    fn a_step_that_is_far_too_long_is_refused() {
        let inputs = vec![Voltage { u: 0.0 }; 5];
        let time = Time::Uniform { start: 0.0, step: 0.5 };
        let run = |a: f64, i: f64| Simulator::new(&Decay).run(&Rate { a }, &Current { i }, time.clone(), &inputs);
        assert!((run(2.0, 1.0).unwrap().states[1].i - 0.375).abs() < 1e-15);
        assert!(run(4.0, 0.0).is_ok());
        let Err(Error::Simulation(failure)) = run(4.0, 1.0) else { panic!("accepted") };
        assert_eq!((failure.sample, &failure.signal[..]), (1, "state `i`"));
        assert!(
            (failure.value - 1.0 / 3.0).abs() < 1e-15 && failure.hint.contains("choose another integrator, Rk45"),
            "{failure}"
        );
        let chosen = Simulator::new(&Decay).integrator(Rk4 { substeps: 1 });
        let kept = chosen.run(&Rate { a: 4.0 }, &Current { i: 1.0 }, time, &inputs).unwrap();
        assert!((kept.states[1].i - 1.0 / 3.0).abs() < 1e-15);
    }
}
