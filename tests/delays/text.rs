//! Dead times in text models.

use crate::{Heated, Process, record};
use greybox::*;

/// The model as text gives the estimates of its Rust twin, and so does the text that is written of the twin.
#[test]
fn in_a_text_model() {
    let text = r#"
greybox = 1
[inputs]
u = { unit = "%", delay = "theta" }
[parameters]
y0 = { unit = "K", start = 20 }
k = { unit = "K/%", start = 1 }
tau = { unit = "s", start = 20, positive = true }
theta = { unit = "s", start = 5, within = [0, 60] }
[states]
z = { unit = "K", derivative = "(k*u - z)/tau", initial = 0 }
[outputs]
y = { value = "y0 + z", unit = "K" }
"#;
    let read = text::Model::named("process.toml", text).unwrap();
    assert!(read.warnings().is_empty(), "{:?}", read.warnings());
    let typed = record().record().clone();
    let found = read.fit(&[read.prepare(typed.clone()).unwrap()]).unwrap().run().unwrap();
    let theta = free(5.0).within(0.0, 60.0);
    let parameters = Process { y0: free(20.0), k: free(1.0), tau: free(20.0).log(), theta };
    let expected = Fit::new(&Heated, &record()).parameters(parameters).run().unwrap();
    let close = |found: &estimate::Summary| {
        for (found, expected) in found.unknowns.iter().zip(&expected.unknowns) {
            assert!(
                (found.value / expected.value - 1.0).abs() < 1e-9,
                "{}: {} {}",
                found.name,
                found.value,
                expected.value
            );
        }
    };
    close(&found);
    let equations = equations::Equations::trace(&Heated).unwrap();
    let written = text::Model::of(&equations, "process", read.parameters()).unwrap();
    assert!(written.to_toml().contains("u = { unit = \"%\", delay = \"theta\" }"), "{}", written.to_toml());
    close(&written.fit(&[typed]).unwrap().run().unwrap());
    // A dead time is a time.
    let wrong = text::Model::named("process.toml", &text.replace("delay = \"theta\"", "delay = \"k\"")).unwrap();
    assert!(
        wrong.warnings().iter().any(|one| one.to_string().contains("the dead time of `u`")),
        "{:?}",
        wrong.warnings()
    );
}
