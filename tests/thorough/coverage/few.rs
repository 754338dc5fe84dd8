//! Unknowns that one or two measurements determine, whose noise may be another than that of all others; and weights and losses with
//! many measurements of changing noise.

use super::Trial;
use super::cases::{LAG, WINDING, clean, levels, record, supply, winding};
use super::models::Armature;
use crate::common::{Affine, Branch, Current, Lag, Straight, Voltage};
use crate::random::Random;
use greybox::loss::Tukey;
use greybox::{Experiment, Fit, Huber, Sample, Time, free};

/// How a straight line is fitted.
#[derive(Clone, Copy, PartialEq)]
pub enum By {
    Squares,
    Huber,
    Weights,
}

/// A straight line through 40 measurements between -1 and 1, and one at 18, which is so many times as noisy. What the others
/// predict there has five times their noise.
pub fn far(random: &mut Random, noisier: f64, by: By) -> Trial {
    let inputs: Vec<Voltage> =
        (0..41).map(|k| Voltage { u: if k == 20 { 18.0 } else { 2.0 * random.uniform() - 1.0 } }).collect();
    let noise = |u: f64| if u > 1.0 { 0.1 * noisier } else { 0.1 };
    let outputs = inputs.iter().map(|u| Current { i: 1.5 * u.u - 0.7 + noise(u.u) * random.normal() }).collect();
    straight(inputs, outputs, by)
}

/// A straight line with noise that grows with the input's square.
pub fn line(random: &mut Random, samples: usize, by: By) -> Trial {
    let inputs: Vec<Voltage> = (0..samples).map(|_| Voltage { u: random.normal() }).collect();
    let noise = |u: f64| 0.1 + 0.3 * u * u;
    let outputs = inputs.iter().map(|u| Current { i: 1.5 * u.u - 0.7 + noise(u.u) * random.normal() }).collect();
    straight(inputs, outputs, by)
}

fn straight(inputs: Vec<Voltage>, outputs: Vec<Current>, by: By) -> Trial {
    let record = Experiment::new(&Straight, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
    let fit = Fit::new(&Straight, &record).parameters(Affine { slope: free(1.0), offset: free(0.0) });
    let fit = match by {
        By::Squares => fit,
        By::Huber => fit.loss(Huber(1.345)),
        By::Weights => fit.weighting(|_: &Sample<Straight>| 1.0),
    };
    Trial { summary: fit.run().unwrap().into_summary(), truth: vec![1.5, -0.7] }
}

/// The first current is estimated with a robust loss; of every so many samples one is measured, 300 in all, with so many
/// outliers (%).
pub fn robust(random: &mut Random, every: usize, outliers: f64, huber: bool) -> Trial {
    let voltage = levels(random, 300 * every, 20);
    let inputs: Vec<Voltage> = voltage.into_iter().map(|u| Voltage { u: 1.5 + 0.5 * u }).collect();
    let start = Current { i: 1.0 };
    let mut outputs = clean(&Lag, 0.01, &inputs, &start, &LAG);
    for (k, y) in outputs.iter_mut().enumerate() {
        let size = if 100.0 * random.uniform() < outliers { 1.0 } else { 0.1 };
        y.i = if k % every == 0 { y.i + size * random.normal() } else { f64::NAN };
    }
    let record = record(&Lag, 0.01, inputs, outputs, start).initial(Current { i: free(0.8) });
    let fit = Fit::new(&Lag, &record).parameters(Branch { gain: free(1.5), tau: free(0.08) });
    let fit = if huber { fit.loss(Huber(1.345)) } else { fit.loss(Tukey(4.685)) };
    Trial { summary: fit.run().unwrap().into_summary(), truth: vec![LAG.gain, LAG.tau, 1.0] }
}

/// The noise grows with the square of the speed, or not; the weights are the inverse of such a variance, or all one.
pub fn weighted(random: &mut Random, every: usize, (grows, weighs): (bool, bool)) -> Trial {
    let inputs = supply(random, 200 * every);
    let sigma = |w: f64| 0.05 + 0.5 * (w / 90.0) * (w / 90.0);
    let start = Current { i: 1.0 };
    let mut outputs = clean(&Armature, 2e-3, &inputs, &start, &WINDING);
    for (k, (y, u)) in outputs.iter_mut().zip(&inputs).enumerate() {
        let noise = if grows { sigma(u.w) } else { 0.2 };
        y.i = if k % every == 0 { y.i + noise * random.normal() } else { f64::NAN };
    }
    let record = record(&Armature, 2e-3, inputs, outputs, start).initial(Current { i: free(0.8) });
    let fit = Fit::new(&Armature, &record).parameters(winding());
    let fit = fit.weighting(move |s: &Sample<Armature>| if weighs { sigma(s.u.w).powi(-2) } else { 1.0 });
    Trial { summary: fit.run().unwrap().into_summary(), truth: vec![WINDING.r, WINDING.l, WINDING.ke, 1.0] }
}
