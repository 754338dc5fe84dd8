//! The meaning of a text: quantities, values of expressions, what is declared.

use greybox::graph::Leaf;
use greybox::layout::{Kind, Quantity};
use greybox::record::{Channel, Initial, Record};
use greybox::text::Model;
use greybox::{Error, Hold, Time, fixed, free};

pub const PMSM: &str = r#"
greybox = 1
name = "PMSM with surface magnets"
[constants]
np = { value = 4, unit = "1" }
[inputs]
ud = { unit = "V", hold = "zero" }
uq = "V"
w = "rad/s"
[parameters]
rs = { unit = "ohm", start = 1.0, within = [0.01, 10] }
ls = { unit = "H", start = 2e-3, positive = true }
ke = { unit = "V s/rad", start = 0.7 }
[let]
we = "np*w"
[states]
id = { unit = "A", derivative = "(ud - rs*id)/ls + we*iq", initial = "first" }
iq = { unit = "A", derivative = "(uq - rs*iq - ke*w*sqrt(2/3))/ls - we*id", initial = "first" }
[outputs]
id = "id"
iq = { value = "iq", unit = "A", noise = 0.05 }
"#;

pub fn model(text: &str) -> Model {
    Model::named("model.toml", text).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_motor() {
    let model = model(PMSM);
    assert!(model.warnings().is_empty(), "{:?}", model.warnings());
    assert_eq!(model.name(), "PMSM with surface magnets");
    let layout = model.equations().layout();
    let named =
        |all: &[Quantity]| all.iter().map(|one| format!("{} ({})", one.name, one.unit)).collect::<Vec<_>>().join(", ");
    assert_eq!(layout.kind, Kind::Continuous);
    assert_eq!(named(&layout.inputs), "ud (V), uq (V), w (rad/s)");
    assert_eq!(named(&layout.parameters), "rs (ohm), ls (H), ke (V s/rad)");
    assert_eq!(named(&layout.states), "id (A), iq (A)");
    assert_eq!(model.parameters(), [free(1.0).within(0.01, 10.0), free(2e-3).positive(), free(0.7)]);
    assert_eq!((model.holds(), model.initial()), (vec![Some(Hold::Zero), None, None], Initial::FirstSample));
    assert_eq!(model.constants(), [("np", 4.0, "1")]);
    assert_eq!(model.to_toml(), PMSM);
}

/// Of a report: what was fitted is all there.
#[test]
fn a_section_has_dead_times_and_noise() {
    let text = PMSM.replace("ke = {", "late = { unit = \"s\", start = 1e-3 }\nke = {");
    let text = text.replace("hold = \"zero\" }", "hold = \"zero\", delay = \"2*late\" }");
    let text =
        text.replacen("initial = \"first\" }", "initial = \"first\", diffusion = 0.25, initial_noise = 0.5 }", 1);
    let table = greybox::report::Section::from(&model(&text)).tables[0].to_string();
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split_whitespace().collect()).collect();
    for row in ["delay of ud 2*late", "diffusion of id 0.25", "noise of iq 0.05", "initial noise of id 0.5", "np 4"] {
        assert!(rows.iter().any(|cells| cells.join(" ") == row), "{row} in\n{table}");
    }
    assert!(!table.lines().any(|line| line.starts_with("noise of id")), "{table}");
}

/// Levels of noise may depend on states, inputs and time, in each form of the model.
#[test]
fn levels_that_move() {
    let text = "greybox = 1\n[parameters]\nq = { start = 0.1 }\n[inputs]\nu = \"V\"\n\
         [states]\nx = { unit = \"V\", next = \"0.5*x + u\", diffusion = \"q*abs(x) + 0.1*t\" }\n\
         [outputs]\ny = { value = \"x\", unit = \"V\", noise = \"0.02*y0 + 0.3*u\" }\n[let]\ny0 = \"2*x\"";
    let levels = |of: &Model| {
        let roots = [&*of.equations().roots().diffusion, &of.equations().roots().noise].concat();
        of.equations().graph().evaluate(&roots, |leaf| match leaf {
            Leaf::State(_) => -3.0,
            Leaf::Input(_) => 2.0,
            Leaf::Time => 4.0,
            _ => 0.7f64,
        })
    };
    let read = model(text);
    let expected = [0.7 * 3.0 + 0.1 * 4.0, 0.02 * (2.0 * -3.0) + 0.3 * 2.0];
    assert_eq!(levels(&read), expected);
    assert_eq!(levels(&Model::of(read.equations(), "model", read.parameters()).unwrap()), expected);
    // No number that a fit could take as given.
    assert_eq!(read.noise(), [None]);
    let code = read.to_rust().unwrap();
    for signature in ["fn diffusion<S: Scalar>(&self, t: S, x: &", "fn noise<S: Scalar>(&self, _t: S, x: &"] {
        assert!(code.contains(signature), "{code}");
    }
}

/// The state at the first sample as an expression, or as that of rest, in each form of the model.
#[test]
fn initial_states() {
    let text = |initial: &str| {
        format!(
            "greybox = 1\noutputs = [\"x\"]\n[parameters]\na = {{ start = 0.5 }}\n[inputs]\nu = \"V\"\n\
             [states]\nx = {{ unit = \"V\", derivative = \"u - a*x\", initial = {initial} }}\nz = {{ derivative = \"x - z\"{} }}",
            if initial == "\"steady\"" { ", initial = \"steady\"" } else { "" }
        )
    };
    let steady = model(&text("\"steady\""));
    assert_eq!(steady.initial(), Initial::Steady);
    let table = greybox::report::Section::from(&steady).tables[0].to_string();
    assert!(table.contains("at rest under the first inputs"), "{table}");
    let read = model(&text("\"u/a + 1\""));
    assert_eq!(read.initial(), Initial::Estimated);
    let begin = |of: &Model| {
        let equations = of.equations();
        equations.graph().evaluate(&equations.roots().initial, |leaf| if leaf == Leaf::Input(0) { 3.0 } else { 0.5 })
    };
    let json: greybox::equations::Equations =
        serde_json::from_str(&serde_json::to_string(&**read.equations()).unwrap()).unwrap();
    let again = Model::of(read.equations(), "model", read.parameters()).unwrap();
    let of_json = Model::of(&json, "model", read.parameters()).unwrap();
    for of in [&read, &again, &of_json] {
        let found: Vec<f64> = begin(of);
        assert!(found[0] == 7.0 && found[1].is_nan(), "{found:?}");
    }
    let code = read.to_rust().unwrap();
    assert!(code.contains("fn initial<S: Scalar>(&self, u: &Of<Self::Input, S>, p: &"), "{code}");
    let table = greybox::report::Section::from(&read).tables[0].to_string();
    assert!(table.lines().any(|line| line.split_whitespace().eq(["x(0)", "u/a", "+", "1"])), "{table}");
}

/// The value of an expression of `x` (0.7), `y` (-1.3), `p` (2) and the time (3).
fn value(expression: &str) -> f64 {
    let text = format!(
        "greybox = 1\n[inputs]\nx = \"\"\ny = \"\"\n[parameters]\np = {{ start = 1 }}\n[constants]\nn = 3\nhalf = \"n/6\"\n\
         [tables.curve]\nx = [0, 1, 3]\nvalues = [0, 2, 3]\noutside = \"hold\"\n\
         [tables.map]\nx = [0, 1]\ny = [-2, 0, 2]\nvalues = [[0, 1, 2], [3, 4, 5]]\noutside = \"linear\"\n\
         [let]\nlater = \"2*sooner\"\nsooner = \"x + 1\"\n[outputs]\nvalue = '''{expression}'''"
    );
    let equations = model(&text).equations().clone();
    equations.graph().evaluate::<f64>(&equations.roots().output, |leaf| match leaf {
        Leaf::Input(0) => 0.7,
        Leaf::Input(_) => -1.3,
        Leaf::Parameter(_) => 2.0,
        _ => 3.0,
    })[0]
}

/// Each expression has the value that the same arithmetic has in Rust: to the bit, for it is the same operations.
#[test]
fn expressions() {
    let (x, y, p, t) = (0.7f64, -1.3f64, 2.0f64, 3.0f64);
    #[rustfmt::skip]
    let cases = [
        ("2/3", 2.0 / 3.0), ("-x^2", -(x * x)), ("2^3^2", 512.0), ("x**3", x.powi(3)), ("2*x - y/p", 2.0 * x - y / p), ("x^-2", x.powi(-2)),
        ("x^0.3", x.powf(0.3)), ("x^y", x.powf(y)), ("x^n", x.powi(3)), ("t*pi", t * core::f64::consts::PI), ("1e-3*x", 1e-3 * x),
        ("later", 2.0 * (x + 1.0)), ("half", 0.5), ("min(x, y, t)", y), ("max(x, y, t)", t), ("clamp(y, -1, 1)", -1.0),
        ("clamp(x, -1, 1)", x), ("if x < y then 1 else 2", 2.0), ("if x >= y and not y > 0 then 1 else 2", 1.0),
        ("if x < y or x < 1 and y < 0 then 1 else if x < 2 then 2 else 3", 1.0), ("if not (x > 0 or y > 0) then 1 else 2", 2.0),
        ("sqrt(x) + cbrt(x)", x.sqrt() + x.cbrt()), ("exp(x) + exp2(x) + exp_m1(x)", x.exp() + x.exp2() + x.exp_m1()),
        ("ln(x) + ln_1p(x) + log2(x) + log10(x)", x.ln() + x.ln_1p() + x.log2() + x.log10()),
        ("sin(x) + cos(x) + tan(x)", x.sin() + x.cos() + x.tan()), ("asin(x) + acos(x) + atan(x)", x.asin() + x.acos() + x.atan()),
        ("sinh(x) + cosh(x) + tanh(x)", x.sinh() + x.cosh() + x.tanh()), ("asinh(x) + acosh(t) + atanh(x)", x.asinh() + t.acosh() + x.atanh()),
        ("atan2(y, x)", y.atan2(x)), ("hypot(x, y)", x.hypot(y)), ("copysign(x, y)", -x), ("abs(y)", 1.3), ("signum(y)", -1.0),
        ("floor(y)", -2.0), ("ceil(y)", -1.0), ("round(y)", -1.0), ("trunc(y)", -1.0), ("fract(y)", y + 1.0), ("recip(p)", 0.5),
        ("rem_euclid(y, 1)", y.rem_euclid(1.0)), ("pow(x, 2)", x * x), ("curve(0.5)", 1.0), ("curve(9)", 3.0), ("curve.x(x)", 2.0),
        ("map(0.5, x)", 1.5 + 1.0 + x / 2.0), ("map.x(x, y)", 3.0), ("map.y(x, y)", 0.5), ("map(2, 0)", 7.0), ("`x`", x),
    ];
    for (expression, expected) in cases {
        let found = value(expression);
        // A table's value is a weighted sum of its points; a whole power is multiplied in an order that the compiler chooses.
        let close = if expression.contains("map") || expression.contains("curve") || expression.contains('^') {
            1e-15
        } else {
            0.0
        };
        assert!((found - expected).abs() <= close * expected.abs(), "{expression}: {found} {expected}");
    }
}

#[test]
fn kinds_and_what_is_declared() {
    let discrete = model(
        "greybox = 1\noutputs = [\"x\"]\n[parameters]\na = { start = 0.5, log = true, prior = { mean = 0.4, sd = 0.1 } }\n\
         b = { fixed = 2 }\nq = { start = 0.1, per_experiment = true }\n[inputs]\nu = { unit = \"V\", hold = \"first\" }\n\
         [states]\nx = { next = \"a*x + b*u\", initial = 0.3, diffusion = \"q\", initial_noise = \"2*q\" }\nz = { next = \"z\", initial = { start = 1, within = [0, 2] } }",
    );
    assert_eq!(discrete.equations().layout().kind, Kind::Discrete);
    assert_eq!(discrete.parameters(), [free(0.5).log().prior(0.4, 0.1), fixed(2.0), free(0.1).per_experiment()]);
    assert_eq!(discrete.initial(), Initial::Given(vec![fixed(0.3), free(1.0).within(0.0, 2.0)]));
    assert_eq!((discrete.holds(), discrete.noise()), (vec![Some(Hold::First)], vec![None]));
    let equations = discrete.equations();
    assert_eq!([equations.roots().diffusion.len(), equations.roots().initial_noise.len()], [2, 2]);
    let levels = |of: &Model| {
        let roots = [&*of.equations().roots().diffusion, &of.equations().roots().initial_noise].concat();
        of.equations().graph().evaluate(&roots, |_| 0.7f64)
    };
    assert_eq!(levels(&discrete), [0.7, 0.0, 1.4, 0.0]);
    // As a file of its equations, and as Rust.
    assert_eq!(levels(&Model::of(equations, "model", discrete.parameters()).unwrap()), [0.7, 0.0, 1.4, 0.0]);
    let json = serde_json::to_string(&**equations).unwrap();
    assert_eq!(serde_json::from_str::<greybox::equations::Equations>(&json).unwrap(), **equations);
    let code = discrete.to_rust().unwrap();
    let function = code.split("fn initial_noise").nth(1).unwrap();
    assert!(function.contains("x: p.q * 2.0,") && function.contains("z: S::from(0.0),"), "{function}");
    let fixed_output =
        model("greybox = 1\n[inputs]\nu = \"V\"\n[outputs]\ny = { value = \"2*u\", unit = \"V\", noise = 0.1 }");
    assert_eq!(fixed_output.equations().layout().kind, Kind::Static);
    assert_eq!((fixed_output.noise(), fixed_output.initial()), (vec![Some(0.1)], Initial::Estimated));
}

/// A state with `jump` alone is held, one with both follows its derivative; what is written of the equations, as a file, JSON and Rust, says the same.
#[test]
fn states_that_jump() {
    let text = "greybox = 1\noutputs = [\"x\"]\n[inputs]\nr = \"V\"\ndose = \"V\"\n[parameters]\na = { unit = \"1/s\", start = 0.5 }\nk = { start = 0.4 }\n\
                [states]\nz = { unit = \"V\", jump = \"z + k*(r - x)\", initial = 0 }\n\
                x = { unit = \"V\", derivative = \"a*(z - x)\", jump = \"x + dose\" }\nw = { unit = \"V\", derivative = \"-a*w\" }";
    let sampled = model(text);
    assert!(sampled.warnings().is_empty(), "{:?}", sampled.warnings());
    let values = |of: &greybox::equations::Equations| {
        let roots = [&*of.roots().state, &of.roots().jump].concat();
        of.graph().evaluate::<f64>(&roots, |leaf| match leaf {
            Leaf::State(i) => [0.3, 0.2, 0.9][i as usize],
            Leaf::Input(i) => [1.0, 0.1][i as usize],
            Leaf::Parameter(i) => [0.5, 0.4][i as usize],
            _ => f64::NAN,
        })
    };
    let expected = [0.0, 0.5 * (0.3 - 0.2), -0.45, 0.3 + 0.4 * (1.0 - 0.2), 0.2 + 0.1, 0.9];
    let equations = sampled.equations();
    let again = Model::of(equations, "model", sampled.parameters()).unwrap();
    let json = serde_json::to_string(&**equations).unwrap();
    assert_eq!(serde_json::from_str::<greybox::equations::Equations>(&json).unwrap(), **equations);
    for found in [values(equations), values(again.equations())] {
        assert!(found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-15), "{found:?}");
    }
    let code = sampled.to_rust().unwrap();
    let function = code.split("fn jump").nth(1).unwrap();
    assert!(function.contains("z: x.z + p.k * (u.r - x.x),") && function.contains("w: x.w,"), "{function}");
    assert!(code.contains("z: S::from(0.0),"), "{code}");
    assert!(equations.to_string().contains("x after a sample = x + dose"), "{equations}");
    assert!(sampled.to_latex().contains("x(t_k^+) &= x + "), "{}", sampled.to_latex());
    assert!(!equations.to_string().contains("w after"));
    let wrong = Model::named("m", &text.replace("derivative", "next")).unwrap_err().to_string();
    assert!(wrong.contains("has `jump`, but the model is discrete") && wrong.contains("by `next` alone"), "{wrong}");
    let warned = model(&text.replace("x + dose", "x + dose*a"));
    let warned = warned.warnings().iter().map(|one| one.title().to_owned()).collect::<Vec<_>>();
    assert!(warned.iter().any(|title| title.contains("V") && title.contains("V/s")), "{warned:?}");
}

/// Every sample of a discrete model or of one with `jump` is a step of it: fewer samples would be another plant.
#[test]
fn records_are_thinned_where_the_plant_stays() {
    let thinned = |state: &str, n: usize| {
        let text =
            "greybox = 1\n[inputs]\nu = \"\"\n[parameters]\na = { start = 1 }\n[outputs]\ny = \"x\"\n[states]\nx = ";
        let model = model(&format!("{text}{{ {state} }}"));
        let channel = |name: &str, k: f64| Channel::new(name, "", (0..6).map(|i| k * f64::from(i)).collect::<Vec<_>>());
        let states = model.equations().layout().states.clone();
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let record = Record::new(states, time, vec![channel("u", 1.0)], vec![channel("y", 2.0)]).unwrap();
        model.thinned(&record, n).map(|record| record.outputs()[0].values.to_vec())
    };
    assert_eq!(thinned("derivative = \"-a*x + u\"", 2).unwrap(), [0.0, 4.0, 8.0]);
    for (state, why) in
        [("next = \"a*x + u\"", "the model is discrete"), ("jump = \"x + u\"", "samples change state `x`")]
    {
        let error = thinned(state, 2).unwrap_err();
        assert!(matches!(error, Error::Thinned { every: 2, .. }), "{error}");
        let said = error.to_string();
        assert!(said.contains(why) && said.contains("Record::decimate(2)") && said.contains("resample"), "{said}");
        assert_eq!(thinned(state, 1).unwrap().len(), 6);
    }
}

/// A constant that is set has its new value in the equations and in the file; comments stay.
#[test]
fn constants_are_set() {
    let mut model = model(&PMSM.replace("[inputs]", "# of the rotor\n[inputs]"));
    model.set_constant("np", 3.0).unwrap();
    assert_eq!(model.constants(), [("np", 3.0, "1")]);
    assert!(model.equations().to_string().contains("3.0 * w"), "{}", model.equations());
    let text = model.to_toml();
    assert!(text.contains("np = { value = 3.0, unit = \"1\" }\n# of the rotor"), "{text}");
    let error = model.set_constant("npp", 1.0).unwrap_err().to_string();
    assert_eq!(error, "there is no constant `npp`; did you mean `np`?");
    assert_eq!(model.set_constant("np", f64::NAN).unwrap_err().to_string(), "constant `np` is NaN; it must be finite");
}
