//! Noise that a text gives for some of its outputs.

use crate::meaning::{PMSM, model};
use greybox::estimate::NoiseModel;
use greybox::record::Record;
use greybox::text::Model;
use greybox::{DataFile, Fit, Summary};

fn record(text: &Model) -> Record {
    DataFile::new("examples/data/pmsm.csv").read_record(text.equations().layout()).unwrap()
}

fn values(found: &Summary) -> Vec<f64> {
    found.unknowns.iter().map(|one| one.value).collect()
}

/// The noise of `iq` is what the text says, that of `id` is estimated; the answer is that of both given so.
#[test]
fn the_noise_of_the_other_outputs_is_estimated() {
    for level in ["0.05", "0.5"] {
        let text = model(&PMSM.replace("noise = 0.05", &format!("noise = {level}")));
        let record = record(&text);
        let found = text.fit(std::slice::from_ref(&record)).unwrap().run().unwrap();
        assert_eq!(found.method.noise, NoiseModel::SomeGiven(1));
        let sigma: Vec<f64> = found.outputs.iter().map(|output| output.fit.sigma).collect();
        assert_eq!(sigma[1], level.parse::<f64>().unwrap());
        // The record was made with 0.05 A; 2000 samples tell it to 1.6 %.
        assert!((sigma[0] / 0.05 - 1.0).abs() < 0.05, "{sigma:?}");
        let prepared = text.prepare(record).unwrap();
        let given = Fit::new(&**text.equations(), &prepared).parameters(text.parameters().to_vec()).noise(sigma);
        let given = given.run().unwrap();
        for ((found, given), unknown) in values(&found).iter().zip(values(&given)).zip(&given.unknowns) {
            let error = unknown.knowledge.standard_error().unwrap_or(0.0);
            // The level that is reported is larger than that of the search by the degrees of freedom, 0.04 %.
            assert!((found - given).abs() <= 1e-3 * error + 1e-12, "{level}: {found} {given} {error}");
        }
    }
    // With ten times the noise, `iq` weighs a hundredth: another answer than with both estimated.
    let [some, none] = [", noise = 0.5", ""].map(|noise| {
        let text = model(&PMSM.replace(", noise = 0.05", noise));
        text.fit(&[record(&text)]).unwrap().run().unwrap()
    });
    assert_eq!(none.method.noise, NoiseModel::PerOutput);
    let moved = (values(&some)[2] - values(&none)[2]).abs();
    assert!(moved > 0.1 * none.unknowns[2].knowledge.standard_error().unwrap(), "{moved}");
}

/// An output that is a mere quantity has its unit; one that is not has what it is given.
#[test]
fn outputs_have_the_units_of_their_quantities() {
    let units =
        |text: &str| model(text).equations().layout().outputs.iter().map(|one| one.unit.clone()).collect::<Vec<_>>();
    assert_eq!(units(PMSM), ["A", "A"]);
    let text = PMSM.replace(
        "id = \"id\"",
        "id = \"id\"\nspeed = \"w\"\nnumber = \"2*id\"\nother = { value = \"id\", unit = \"1\" }",
    );
    assert_eq!(units(&text), ["A", "rad/s", "", "1", "A"]);
}
