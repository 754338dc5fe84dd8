//! Texts against the Rust models that they say: the models that ship, and traced models as texts.

use approx::assert_relative_eq;
use greybox::equations::Equations;
use greybox::graph::Leaf;
use greybox::layout::Quantity;
use greybox::models::{Positioning, PositioningLoop};
use greybox::pmsm::*;
use greybox::record::{Channel, Record};
use greybox::text::{Model, shipped};
use greybox::{Automatic, Fit, Kind, Parameter, Summary, Time, fixed, signals};

signals! {
    struct Cable { rs: "ohm", ls: "H", ke: "V s/rad", r_cable: "ohm" }
    struct Harmonic { rs: "ohm", ls: "H", ke: "V s/rad", ke6: "V s/rad" }
    struct Magnet { rs: "ohm", ls: "H", psi_m: "Wb" }
    struct Aligned { rs: "ohm", ls: "H", ke: "V s/rad", vdt: "V", i0: "A", tau: "s", delta: "rad" }
}

/// The Rust model of each text that ships.
fn twin(name: &str) -> Equations {
    let surface = Surface::new(4).unwrap();
    let step = || ExactStep::new(4, 1e-4, HeldIn::Stationary).unwrap();
    let traced = match name {
        "pmsm" => Equations::trace(&surface),
        "salient" => Equations::trace(&Salient::new(4).unwrap()),
        "saturated" => Equations::trace(&Saturated::new(4).unwrap()),
        "flux_mapped" => {
            // The numbers of the file are taken from it.
            let text = Model::shipped(name).unwrap();
            let tables: Vec<_> = text.equations().graph().tables().iter().map(|table| (**table).clone()).collect();
            let is_d = |table: &greybox::Table| table.at2(40.0, 0.0) > 0.1;
            let d = tables.iter().find(|table| is_d(table)).unwrap().clone();
            let q = tables.iter().find(|table| !is_d(table)).unwrap().clone();
            Equations::trace(&FluxMapped::new(4, d, q).unwrap())
        }
        "flux_linkage" => Equations::trace(&FluxLinkage::<_, Magnet>::new(surface)),
        "cabled" => Equations::trace(&Cabled::<_, Cable>::new(surface)),
        "emf_harmonic" => Equations::trace(&EmfHarmonic::<_, Harmonic>::new(surface)),
        "compensated" => Equations::trace(&Compensated::<_, CompensatedWinding>::new(surface)),
        "inverter_fed" => Equations::trace(&InverterFed::<_, InverterFedWinding>::new(surface)),
        "misaligned" => Equations::trace(&Misaligned::<_, Aligned>::new(InverterFed::<_, Aligned>::new(surface))),
        "machine" => Equations::trace(&Machine::new(4, 100.0).unwrap()),
        "shaft" => Equations::trace(&Shaft::new(100.0).unwrap()),
        "exact_surface" => Equations::trace(&ExactSurface(step())),
        "exact_salient" => Equations::trace(&ExactSalient(step())),
        "positioning" => Equations::trace(&Positioning::EMPS),
        "positioning_loop" => Equations::trace(&PositioningLoop::EMPS),
        other => panic!("{other} has no twin"),
    };
    traced.unwrap()
}

/// States' equations, outputs, initial states and jumps where each quantity is a number of its own; what is not said, not a number, is the largest.
pub fn values(equations: &Equations, seed: u64) -> Vec<f64> {
    let roots = equations.roots();
    let roots = [&*roots.state, &roots.output, &roots.initial, &roots.jump].concat();
    let number = |group: u64, i: u32| {
        let mix = (seed * 64 + group * 16 + u64::from(i) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        0.2 + (mix >> 11) as f64 / (1u64 << 53) as f64
    };
    let found = equations.graph().evaluate::<f64>(&roots, |leaf| match leaf {
        Leaf::State(i) => number(0, i),
        Leaf::Input(i) => number(1, i),
        Leaf::Parameter(i) => number(2, i),
        _ => 0.7,
    });
    found.into_iter().map(|value| if value.is_nan() { f64::MAX } else { value }).collect()
}

/// Layouts are equal, and so are values: to a few roundings of the largest term.
#[test]
fn texts_say_what_their_twins_say() {
    for one in shipped() {
        let text = Model::named(one.name, one.text).unwrap_or_else(|error| panic!("{error}"));
        assert!(text.warnings().is_empty(), "{:?}", text.warnings());
        let (found, expected) = (text.equations(), twin(one.name));
        assert_eq!(found.layout(), expected.layout(), "{}", one.name);
        for seed in 0..20 {
            let (found, expected) = (values(found, seed), values(&expected, seed));
            assert_eq!(found.len(), expected.len(), "{}", one.name);
            for (found, expected) in found.into_iter().zip(expected) {
                assert_relative_eq!(found, expected, max_relative = 1e-12, epsilon = 1e-12);
            }
        }
    }
}

/// A record of some excitation, simulated with the declared starts as truth.
fn record(text: &Model, noise: f64) -> Record {
    let layout = text.equations().layout();
    let scale = |name: &str| match name {
        "ud" | "uq" => 20.0,
        "w" => 80.0,
        "theta" => 3.0,
        "iq" => 4.0,
        "vir" => 2.0,
        "qg" => 0.1,
        _ => 0.5,
    };
    let sample = |k: usize| -> Vec<f64> {
        let value = |(i, name): (usize, &str)| {
            let square = if (k / (11 + 6 * i)).is_multiple_of(2) { 1.0 } else { -0.6 };
            scale(name) * (square + 0.3 * (0.13 * k as f64 * (i + 1) as f64).sin())
        };
        layout.inputs.iter().map(|one| one.name.as_str()).enumerate().map(value).collect()
    };
    let inputs: Vec<Vec<f64>> = (0..160).map(sample).collect();
    let truth: Vec<f64> =
        text.parameters().iter().map(|one| 1.1 * one.start + if one.start == 0.0 { 1e-4 } else { 0.0 }).collect();
    let step = if layout.kind == Kind::Discrete { 1e-4 } else { 2e-4 };
    let channel = |(i, one): (usize, &Quantity)| {
        Channel::new(&one.name, &one.unit, inputs.iter().map(|row| row[i]).collect::<Vec<f64>>())
    };
    let channels: Vec<Channel> = layout.inputs.iter().enumerate().map(channel).collect();
    let inputs = Record::new(layout.states.clone(), Time::Uniform { start: 0.0, step }, channels, vec![]).unwrap();
    let truth: Vec<Parameter> = truth.into_iter().map(fixed).collect();
    // By the method that fits begin with: this excitation is too much for some of the models.
    let fit = Fit::new(&**text.equations(), &[] as &[Record]).parameters(truth).integrator(Automatic::default());
    let made = fit.simulate(&vec![0.0; layout.states.len()], &inputs).unwrap();
    let size = |j: usize| made.outputs()[j].values.iter().fold(0.0, |size: f64, y| size.max(y.abs()));
    let sigma: Vec<f64> = (0..layout.outputs.len()).map(|j| noise * (size(j) + 1e-6)).collect();
    text.prepare(made.with_noise(&sigma, 3)).unwrap()
}

fn fitted(equations: &Equations, record: &Record, parameters: &[Parameter]) -> Summary {
    Fit::new(equations, record).parameters(parameters.to_vec()).run().unwrap()
}

/// Estimates, intervals, outcome, warnings and engine of a text are those of its twin.
#[test]
fn texts_fit_as_their_twins_fit() {
    for one in shipped() {
        let text = Model::named(one.name, one.text).unwrap();
        let record = record(&text, 2e-3);
        let found = text.fit(std::slice::from_ref(&record)).unwrap().run().unwrap();
        let expected = fitted(&twin(one.name), &record, text.parameters());
        let codes = |summary: &Summary| summary.warnings.iter().map(|warning| warning.code).collect::<Vec<_>>();
        assert_eq!(codes(&found), codes(&expected), "{}\n{found}\n{expected}", one.name);
        assert_eq!(std::mem::discriminant(&found.outcome), std::mem::discriminant(&expected.outcome), "{}", one.name);
        assert_eq!(found.method.engine, expected.method.engine, "{}", one.name);
        for (a, b) in found.unknowns.iter().zip(&expected.unknowns) {
            // Ten digits, or a millionth of what is known of it.
            let error = b.knowledge.standard_error().unwrap_or(0.0);
            assert_relative_eq!(a.value, b.value, max_relative = 1e-10, epsilon = 1e-6 * error);
        }
    }
}

/// The equations of each Rust model are written as a text, which says the same to the bit.
#[test]
fn traced_models_are_texts() {
    for one in shipped() {
        let (equations, declared) = (twin(one.name), Model::shipped(one.name).unwrap());
        let written = Model::of(&equations, one.name, declared.parameters()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(written.equations().layout(), equations.layout());
        assert_eq!(written.parameters(), declared.parameters());
        for seed in 0..5 {
            assert_eq!(values(written.equations(), seed), values(&equations, seed), "{}", written.to_toml());
        }
    }
}
