//! `fit --derived`: quantities computed from the parameters.

use crate::bench::Bench;
use greybox::Summary;
use greybox::diagnose::Derived;

/// The lines of the quantities, and what the JSON has of them.
fn derived(expressions: &[&str]) -> (String, Vec<Derived>) {
    let bench = Bench::new();
    let said = expressions.iter().flat_map(|one| ["--derived", one]);
    let words: Vec<&str> = ["fit", "pmsm.toml", "record.csv", "--json", "e.json"].into_iter().chain(said).collect();
    let (out, _) = bench.ends(0, &words);
    let estimate = Summary::from_json(&std::fs::read_to_string(bench.path("e.json")).unwrap()).unwrap();
    (out, estimate.derived)
}

/// The truth is 4e-3/0.63, with a standard error of 3e-6 by those of both.
#[test]
fn quantities_are_in_the_json() {
    let (out, found) = derived(&["tau=ls/rs", "small=ls*1e-6"]);
    assert_eq!(found.iter().map(|one| one.name.as_str()).collect::<Vec<_>>(), ["tau", "small"]);
    let (error, (lower, upper)) = (found[0].standard_error.unwrap(), found[0].interval.unwrap());
    assert!((found[0].value - 4e-3 / 0.63).abs() < 1e-5 && error > 1e-7 && error < 1e-5, "{found:?}");
    assert!(lower < found[0].value && found[0].value < upper, "{found:?}");
    assert!(out.contains("tau = 0.00634"), "{out}");
}

#[test]
fn names_of_quantities_are_their_own() {
    let bench = Bench::new();
    for (first, second, says) in [
        ("rs=2*rs", "b=rs", "--derived rs=2*rs: the model has the parameter `rs`; give the quantity another name"),
        ("np=rs", "b=rs", "--derived np=rs: the model has the constant `np`"),
        ("w=rs", "b=rs", "--derived w=rs: the model has the input `w`"),
        ("a=rs", "a=ls", "--derived a=ls: another quantity is called `a`"),
        ("a=2*a", "b=rs", "nothing is called `a`"),
    ] {
        let (_, error) = bench.ends(1, &["fit", "pmsm.toml", "record.csv", "--derived", first, "--derived", second]);
        assert!(error.contains(says), "{error}");
    }
}

/// `rs` is 0.63 within 1e-3, and `ls*157.5` is 0.63 within 5e-4: which of both is the smaller is not known.
#[test]
fn a_step_has_no_standard_error() {
    let (out, found) = derived(&[
        "near=if rs < 157.5*ls then ke else 2*ke",
        "far=if rs < 0.5 then 1 else 2",
        "least=min(rs, ke)",
        "whole=floor(rs*1e5)",
    ]);
    let text = |name: &str| out.lines().find(|line| line.starts_with(name)).unwrap_or_default();
    assert!(
        text("near").contains("not known: it changes within what is known of `rs`, `ls`, but has no slope"),
        "{out}"
    );
    assert!(text("far = 2").ends_with("the same within the 95 % intervals of `rs`"), "{out}");
    assert!(text("whole").contains("not known"), "{out}");
    let [near, far, least, whole] = &found[..] else { panic!("{found:?}") };
    for one in [near, whole] {
        assert!(one.value.is_finite() && one.standard_error.is_none() && one.interval.is_none(), "{one:?}");
    }
    assert_eq!((far.value, far.standard_error, far.interval), (2.0, Some(0.0), Some((2.0, 2.0))));
    // The standard error of `rs`.
    assert!(least.standard_error.is_some_and(|error| error > 5e-5 && error < 1e-3), "{least:?}");
}
