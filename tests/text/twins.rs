//! Texts against the Rust models that they say: the models that ship, and traced models as texts.

use approx::assert_relative_eq;
use greybox::equations::Equations;
use greybox::graph::Leaf;
use greybox::models::{Positioning, PositioningLoop};
use greybox::pmsm::*;
use greybox::signals;
use greybox::text::{Model, shipped};

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
        "positioning" => Equations::trace(&Positioning::EMPS),
        "positioning_loop" => Equations::trace(&PositioningLoop::EMPS),
        other => panic!("{other} has no twin"),
    };
    traced.unwrap()
}

/// States' equations and outputs where each quantity is a number of its own.
fn values(equations: &Equations, seed: u64) -> Vec<f64> {
    let roots = [equations.state(), equations.output()].concat();
    let number = |group: u64, i: u32| {
        let mix = (seed * 64 + group * 16 + u64::from(i) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        0.2 + (mix >> 11) as f64 / (1u64 << 53) as f64
    };
    equations.graph().evaluate::<f64>(&roots, |leaf| match leaf {
        Leaf::State(i) => number(0, i),
        Leaf::Input(i) => number(1, i),
        Leaf::Parameter(i) => number(2, i),
        _ => 0.7,
    })
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
            for (found, expected) in values(found, seed).into_iter().zip(values(&expected, seed)) {
                assert_relative_eq!(found, expected, max_relative = 1e-12, epsilon = 1e-12);
            }
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
