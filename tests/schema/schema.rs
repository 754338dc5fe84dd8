//! What is stored as JSON keeps to the schemas in `schema/`, and what differs is refused by them. The documents are those of the
//! committed example, a report with everything, as the library of today writes them.

use greybox::diagnose::Derived;
use greybox::optimize::Outcome;
use greybox::pmsm::{Surface, Winding};
use greybox::report::{Cell, Section, Table};
use greybox::{Experiment, Fit, Knowledge, Report, Summary, free};
use jsonschema::{Registry, Validator};
use serde_json::Value;
use std::path::Path;

fn read(path: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)).unwrap()
}

/// Both schemas, for references between them.
fn schemas() -> Registry<'static> {
    let schema = |name: &str| serde_json::from_str::<Value>(&read(&format!("schema/{name}.schema.json"))).unwrap();
    let named = |name: &str| format!("json-schema:///{name}.schema.json");
    let registry = Registry::new().add(named("estimate"), schema("estimate")).unwrap();
    registry.add(named("report"), schema("report")).unwrap().prepare().unwrap()
}

fn validator(registry: &Registry<'_>, name: &str) -> Validator {
    let reference = serde_json::json!({ "$ref": format!("json-schema:///{name}.schema.json") });
    jsonschema::options().with_registry(registry).build(&reference).unwrap()
}

fn errors(schema: &Validator, text: &str) -> Vec<String> {
    let value = serde_json::from_str(text).unwrap();
    schema.iter_errors(&value).map(|error| format!("{}: {error}", error.instance_path())).collect()
}

fn example() -> Report {
    Report::from_json(&read("tests/data/report.json")).unwrap()
}

/// A report with its drawings, which are not read back.
fn fitted() -> Report {
    let model = Surface::new(4).unwrap();
    let record = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/data/pmsm.csv");
    let record = Experiment::from_file(&model, record).unwrap();
    let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
    let problem = Fit::new(&model, &record).parameters(start).problem().unwrap();
    Report::new(&problem, &problem.run().unwrap()).unwrap()
}

/// Fields of an estimate that hold numbers, set to `value`.
fn spoiled(estimate: &Summary, value: f64) -> Summary {
    let mut spoiled = estimate.clone();
    (spoiled.cost, spoiled.seconds, spoiled.deviance) = (value, value, Some(value));
    spoiled.outcome = Outcome::Rough { noise: value, errors: value };
    spoiled.unknowns[0].knowledge = Knowledge::Held { bound: value, end: None };
    spoiled.unknowns[1].knowledge = Knowledge::Known { standard_error: value, lower: value, upper: value };
    spoiled.unknowns[1].error_index = Some(value);
    spoiled.parameters[0].value = value;
    spoiled.parameters[0].declared = free(value).within(value, value).prior(value, value);
    let derived = |interval| Derived { name: "tau".to_owned(), value, standard_error: Some(value), interval };
    spoiled.derived = vec![derived(Some((value, value))), derived(None)];
    spoiled.outputs[0].fit.rmse = value;
    spoiled.outputs[0].fit.fit_percent = Some(value);
    spoiled
}

const ODD: [f64; 6] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 5e-324, -0.0, f64::MAX];

#[test]
fn estimates_keep_to_the_schema() {
    let estimate = example().estimate;
    let registry = schemas();
    let schema = validator(&registry, "estimate");
    for summary in [estimate.clone()].into_iter().chain(ODD.map(|value| spoiled(&estimate, value))) {
        let text = summary.to_json().unwrap();
        assert_eq!(errors(&schema, &text), [""; 0]);
    }
    let text = spoiled(&estimate, 1.0).to_json().unwrap();
    let damaged = text.replacen("\"code\": \"held\"", "\"code\": \"kept\"", 1);
    assert!(damaged != text && !errors(&schema, &damaged).is_empty());
}

/// With and without its drawings, and with numbers that JSON has no value for.
#[test]
fn reports_keep_to_the_schema() {
    let registry = schemas();
    let schema = validator(&registry, "report");
    let report = example();
    let drawn = report.to_json_with_drawings().unwrap();
    let fitted = fitted().to_json_with_drawings().unwrap();
    assert_eq!(errors(&schema, &fitted), [""; 0]);
    let cells = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY].map(|value| Cell::number(value, 3));
    let table = Table::new("Odd numbers", ["a", "b", "c"]).row(cells);
    let mut odd = report.clone().with(Section::new("odd", "Odd numbers").table(table));
    odd.estimate = spoiled(&report.estimate, f64::NAN);
    for text in [report.to_json().unwrap(), drawn.clone(), odd.to_json().unwrap()] {
        assert_eq!(errors(&schema, &text), [""; 0]);
    }
    for (right, wrong) in [
        ("\"severity\": \"usable_with_care\"", "\"severity\": \"Bad\""),
        ("\"folded\": true", "\"folded\": 1"),
        ("\"style\": \"measured\"", "\"style\": \"guessed\""),
    ] {
        let text = [&drawn, &fitted].into_iter().find(|text| text.contains(right)).unwrap();
        assert!(!errors(&schema, &text.replacen(right, wrong, 1)).is_empty(), "{wrong}");
    }
}
