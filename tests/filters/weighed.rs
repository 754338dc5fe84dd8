//! Filters with weights and losses.

use crate::common::Noise;
use crate::input_timing::{Leak, Level, Recorded, fit, record};
use greybox::estimate::{Examination, Extent};
use greybox::*;

/// Weights that grow along the record make parts of right records no contradiction, and it is said that these are not compared.
#[test]
fn parts_with_weights_are_not_compared() {
    for seed in 1..=5 {
        let record = record(seed, 0.0, Recorded::Right);
        let found = fit(&record).weighting(|sample: &Sample<Leak>| 1.0 + sample.t).run().unwrap();
        assert!(found.severity() < Severity::NotUsable, "{seed}: {found}");
        let said =
            |one: &Examination| matches!(&one.extent, Extent::Part { without } if without.contains("with weights"));
        assert!(found.examined.iter().any(said), "{seed}: {found}");
    }
}

/// With one outlier of twenty standard deviations in thirty samples, a loss keeps the state, but not the level of the noise: that is said, with care;
/// and nothing of records without outliers.
#[test]
fn outliers_beside_noise_levels_are_named() {
    for seed in 1..=5 {
        let right = record(seed, 0.0, Recorded::Right);
        let mut random = Noise(seed + 99);
        let spoil = |y: Level| Level {
            x: if random.uniform() < 1.0 / 30.0 { y.x + 2.0 * random.gauss().signum() } else { y.x },
        };
        let outputs: Vec<Level> = right.outputs().map(spoil).collect();
        let spoiled =
            Experiment::new(&Leak, right.times().clone(), right.inputs().collect::<Vec<_>>(), outputs).unwrap();
        for loss in [true, false] {
            let said = |record: &ExperimentOf<Leak>| {
                let fit = fit(record);
                let found =
                    if loss { fit.loss(Huber::default()) } else { fit.loss(loss::Tukey::default()) }.run().unwrap();
                found.warnings.iter().find(|warning| warning.code == WarningCode::Outliers).cloned()
            };
            let warning = said(&spoiled).unwrap_or_else(|| panic!("{seed} {loss}"));
            assert!(
                warning.severity == Severity::UsableWithCare && warning.text.contains("noise levels"),
                "{}",
                warning.text
            );
            assert!(said(&right).is_none(), "{seed} {loss}");
        }
    }
}
