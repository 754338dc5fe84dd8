//! What is said beside a result: tests that passed, costs that cannot be compared, noise that is left out, estimates of other models.

use crate::bench::{Bench, MODEL};

/// The model with noise of its outputs and of a state.
fn noisy() -> Bench {
    let bench = Bench::new();
    let outputs = "id = { value = \"id\", noise = 0.05 }\niq = { value = \"iq\", noise = \"0.01 + 0*ke\" }";
    let text = MODEL.replace("id = \"id\"\niq = \"iq\"", outputs);
    let text = text.replace("+ we*iq\" }", "+ we*iq\", diffusion = \"0.1*rs\" }");
    assert!(text.contains("diffusion") && text.contains("noise = 0.05"), "{text}");
    std::fs::write(bench.path("noisy.toml"), text).unwrap();
    bench
}

#[test]
fn a_simulation_says_which_noise_it_is_without() {
    let bench = noisy();
    let truth = ["--fix", "rs=0.63", "--fix", "ls=4e-3", "--fix", "ke=0.95"];
    let remarks = |words: &[&str]| bench.ends(0, &[&["simulate"], words, &["record.csv"], &truth[..]].concat()).1;
    let all = remarks(&["noisy.toml"]);
    let says = "simulated without `noise` of id, iq and `diffusion` of id of the model; --noisy simulates with it";
    assert!(all.lines().any(|line| line == says), "{all}");
    let some = remarks(&["noisy.toml", "--noise", "id=0.05", "--noise", "iq=0.01"]);
    let says = "simulated without `diffusion` of id of the model; --noisy simulates with it";
    assert!(some.lines().any(|line| line == says), "{some}");
    assert!(!remarks(&["pmsm.toml"]).contains("simulated without"));
    assert!(!remarks(&["noisy.toml", "--noisy"]).contains("simulated without"));
    let none = remarks(&["pmsm.toml", "--noisy"]);
    assert!(
        none.contains("--noisy: the model has no noise; it says `noise` of outputs and `diffusion` of states"),
        "{none}"
    );
}

/// Noise of the outputs is drawn as `--noise` draws it, process noise beside it.
#[test]
fn a_noisy_simulation_has_the_noise_of_the_model() {
    let bench = noisy();
    let truth = ["--fix", "rs=0.63", "--fix", "ls=4e-3", "--fix", "ke=0.95"];
    let columns = |words: &[&str]| -> Vec<[f64; 2]> {
        let (out, _) = bench.ends(0, &[&["simulate", "noisy.toml"], words, &["record.csv"], &truth[..]].concat());
        let row = |line: &str| {
            let cells: Vec<f64> = line.rsplit(',').take(2).map(|cell| cell.parse().unwrap()).collect();
            [cells[1], cells[0]]
        };
        out.lines().skip(1).filter(|line| line.starts_with(|c: char| c.is_ascii_digit())).map(row).collect()
    };
    let none = columns(&[]);
    let (given, noisy) = (columns(&["--noise", "id=0.05", "--noise", "iq=0.01"]), columns(&["--noisy"]));
    let both = columns(&["--noisy", "--noise", "id=0", "--noise", "iq=0"]);
    assert_eq!(noisy, columns(&["--noisy", "--seed", "1"]));
    assert_ne!(noisy, columns(&["--noisy", "--seed", "2"]));
    let mut moved = 0.0f64;
    for k in 0..none.len() {
        for j in 0..2 {
            // Of numbers up to some 100, rounded when they are added.
            let added = (noisy[k][j] - both[k][j]) - (given[k][j] - none[k][j]);
            assert!(added.abs() < 1e-12, "{k} {j}: {added}");
        }
        moved = moved.max((both[k][0] - none[k][0]).abs());
    }
    assert_eq!(none.len(), 2000);
    // 0.1 rs / sqrt(2 rs / ls) = 3.6 mA, seldom more than five of them.
    assert!((0.006..0.02).contains(&moved), "{moved}");
}

#[test]
fn tests_that_passed_are_named() {
    let bench = Bench::new();
    let truth =
        ["--fix", "rs=0.63", "--fix", "ls=4e-3", "--fix", "ke=0.95", "--noise", "id=0.05", "--noise", "iq=0.05"];
    // Of other seeds, one of the 32 tests may fail by chance.
    let words = ["simulate", "pmsm.toml", "record.csv", "--seed", "3", "--out", "made.csv"];
    bench.ends(0, &[&words[..], &truth].concat());
    let (out, _) = bench.ends(0, &["residuals", "pmsm.toml", "made.csv"]);
    let out = out.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(out.contains("All tests of all outputs passed: Ljung-Box, 25 lags; "), "{out}");
    assert!(out.contains("zero mean") && out.contains("cross-correlation with input ud"), "{out}");
}

/// A simulation and a filter divide their errors by other deviations, and two outputs have their own in each estimate.
#[test]
fn costs_are_compared_where_they_are_of_one_kind() {
    let bench = noisy();
    let with = |name: &str, from: &str, to: &str| {
        let text = std::fs::read_to_string(bench.path("noisy.toml")).unwrap();
        assert!(text.contains(from), "{text}");
        std::fs::write(bench.path(name), text.replace(from, to)).unwrap();
    };
    with("filter.toml", "[constants]", "[solver]\npredictor = \"kalman\"\n[constants]");
    with("other.toml", "- ke*w", "- 1.01*ke*w");
    let row = |out: &str, name: &str| -> Vec<f64> {
        let line = out.lines().rfind(|line| line.starts_with(name)).unwrap();
        line.split_whitespace().skip(1).filter_map(|cell| cell.replace(',', "").parse().ok()).collect()
    };
    let compare = |other: &str, more: &[&str]| {
        let words = [&["compare", "--model", "noisy.toml", "--model", other, "record.csv"], more].concat();
        String::from_utf8(bench.run(&words).stdout).unwrap()
    };
    let out = compare("filter.toml", &[]);
    let plain = out.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        plain.contains(
            "The costs are left out, because each is of errors that are weighed in another way (noisy.toml: "
        ),
        "{out}"
    );
    // Unknowns and AIC alone.
    assert!(row(&out, "noisy.toml").len() == 2 && row(&out, "filter.toml").len() == 2, "{out}");
    let out = compare("other.toml", &["--noise", "id=0.05", "--noise", "iq=0.05"]);
    assert!(!out.contains("left out") && row(&out, "other.toml").len() == 3, "{out}");
}

#[test]
fn an_estimate_of_another_model_names_the_difference() {
    let bench = Bench::new();
    bench.ends(0, &["fit", "pmsm.toml", "record.csv", "--json", "e.json"]);
    let renamed = MODEL.replace("rs = {", "resistance = {").replace("rs*", "resistance*");
    let unit = MODEL.replace("unit = \"ohm\"", "unit = \"mohm\"");
    let added = MODEL.replace("[let]", "k = { unit = \"1\", start = 1.0 }\n[let]").replace("ke*w*", "ke*k*w*");
    let (first, second) = (
        "rs = { unit = \"ohm\", start = 1.0, within = [0.01, 10] }\n",
        "ls = { unit = \"H\", start = 2e-3, positive = true }\n",
    );
    let order = MODEL.replace(&[first, second].concat(), &[second, first].concat());
    for (model, says) in [
        (renamed, "it has `rs`, which is not in the model, it has no `resistance`, which is in the model"),
        (unit, "`rs` is in \"ohm\" in it and in \"mohm\" in the model"),
        (added, "it has no `k`, which is in the model"),
        (order, "they stand in another order"),
    ] {
        assert_ne!(model, MODEL);
        std::fs::write(bench.path("changed.toml"), model).unwrap();
        for words in [
            ["simulate", "changed.toml", "record.csv", "--estimate", "e.json"],
            ["compare", "-q", "--model", "changed.toml:e.json", "record.csv"],
        ] {
            let (_, error) = bench.ends(1, &words);
            let says = format!("e.json: the estimate is of a model with other parameters: {says}; fit this model");
            assert!(error.contains(&says), "{error}");
        }
    }
    // A record of the fit begins in its states.
    let states = MODEL
        .replace("\nid = { unit", "\ni = { unit")
        .replace("rs*id", "rs*i")
        .replace("we*id", "we*i")
        .replace("id = \"id\"", "id = \"i\"");
    std::fs::write(bench.path("changed.toml"), states).unwrap();
    let (_, error) = bench.ends(1, &["simulate", "changed.toml", "record.csv", "--estimate", "e.json"]);
    assert!(error.contains("other states: it has `id`, which is not in the model, it has no `i`, which is"), "{error}");
}
