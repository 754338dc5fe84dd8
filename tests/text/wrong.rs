//! What is said of texts that are no models: the sentence, the place and the remedy of each kind of mistake.

use crate::meaning::PMSM;
use greybox::text::{Error, Model};

/// A motor's text with one thing changed; what is said, at which line and column, and the remedy.
type Case = (&'static str, &'static str, &'static str, (usize, usize), &'static str);

#[rustfmt::skip]
const CASES: &[Case] = &[
    // The file.
    ("greybox = 1", "greybox 1", "key with no value, expected `=`", (2, 9), "expressions and units stand in quotes, and numbers have digits on both sides of the point"),
    ("greybox = 1", "", "the file does not say which version of the format it has", (1, 1), "let it begin with `greybox = 1`"),
    ("greybox = 1", "greybox = 2", "this library reads version 1 of the format", (2, 11), ""),
    ("[inputs]", "[input]", "a model file has no `input`", (6, 2), "did you mean `inputs`?"),
    ("[inputs]", "inputs = 3\n[zzz]", "a model file has no `zzz`", (7, 2), "a model file may have: greybox, name, description, units, constants, inputs, parameters, tables, let, states, outputs, solver"),
    ("name = \"PMSM with surface magnets\"", "name = 3", "`name` is a number, where a text in quotes should stand", (3, 8), ""),
    ("we = \"np*w\"", "we = np*w", "invalid float", (15, 6), "expressions and units stand in quotes, and numbers have digits on both sides of the point"),
    ("uq = \"V\"", "uq = \"V\"\nuq = \"A\"", "duplicate key", (9, 1), "expressions and units stand in quotes, and numbers have digits on both sides of the point"),
    // Quantities.
    ("rs = { unit = \"ohm\", start = 1.0,", "rs = { unit = \"ohm\", strat = 1.0,", "a parameter has no `strat`", (11, 22), "did you mean `start`?"),
    ("start = 0.7 }", "}", "parameter `ke` has neither `start` nor `fixed`", (13, 1), "give the value that the search starts from: start = 1.0"),
    ("start = 0.7 }", "start = 0.7, fixed = 0.7 }", "parameter `ke` has `start` and `fixed`; leave one out", (13, 1), ""),
    ("start = 0.7 }", "start = \"0.7\" }", "`start` is a text, where a number should stand", (13, 34), "leave out the quotes: start = 0.7"),
    ("start = 0.7 }", "start = nan }", "`start` is NaN; it must be finite", (13, 34), ""),
    ("within = [0.01, 10]", "within = [10, 0.01]", "parameter `rs`: the lower bound 10 is not below the upper bound 0.01", (11, 44), ""),
    ("within = [0.01, 10]", "within = [2, 10]", "parameter `rs` starts at 1, outside its bounds 2 to 10", (11, 44), ""),
    ("within = [0.01, 10]", "within = [1]", "`within` has 1 number(s), where two numbers, [lower, upper] should stand", (11, 44), ""),
    ("positive = true", "positive = 1", "`positive` is a number, where true or false should stand", (12, 45), ""),
    ("start = 0.7 }", "start = -0.7, log = true }", "parameter `ke` is -0.7; a logarithm needs a positive start", (13, 40), ""),
    ("start = 0.7 }", "start = 0.7, prior = { mean = 1 } }", "the prior of parameter `ke` needs `mean` and a positive `sd`", (13, 47), ""),
    ("hold = \"zero\"", "hold = \"cubic\"", "there is no hold `cubic`", (7, 27), "\"zero\": constant from sample to sample; \"first\": a straight line to the next sample"),
    ("[outputs]", "[solver]\nintegrator = \"rk5\"\n[outputs]", "there is no integrator `rk5`", (20, 14), ""),
    ("unit = \"1\"", "unit = \"V/\"", "the unit ends where a symbol should follow", (5, 26), ""),
    ("np = {", "id = {", "`id` is a state and a constant", (17, 1), "rename one"),
    ("np = {", "t = {", "`t` is the time (s), and can be no name of a constant", (5, 1), ""),
    ("np = {", "pi = {", "`pi` is 3.14159, and can be no name of a constant", (5, 1), ""),
    // Kinds and states.
    ("iq = { unit = \"A\", derivative", "iq = { unit = \"A\", next", "state `iq` has `next`, another has `derivative`", (18, 20), "a model is continuous (`derivative`) or discrete (`next`), in all its states"),
    ("iq = { unit = \"A\", derivative =", "iq = { unit = \"A\", description =", "state `iq` has no `derivative`", (18, 1), ""),
    ("we*id\", initial = \"first\"", "we*id\"", "the first sample gives this state, but not `iq`", (17, 70), "write `initial = \"first\"` at all states, or give each a number or `{ start = ... }`"),
    ("initial = \"first\" }\niq = { unit = \"A\", derivative = \"(uq - rs*iq - ke*w*sqrt(2/3))/ls - we*id\", initial = \"first\"", "initial = \"zero\" }\niq = { unit = \"A\", derivative = \"(uq - rs*iq - ke*w*sqrt(2/3))/ls - we*id\"", "nothing is called `zero`", (17, 71), "declare it under [constants], [inputs], [parameters], [states] or [let]"),
    ("initial = \"first\" }\niq = { unit = \"A\", derivative = \"(uq - rs*iq - ke*w*sqrt(2/3))/ls - we*id\", initial = \"first\"", "initial = \"2*iq\" }\niq = { unit = \"A\", derivative = \"(uq - rs*iq - ke*w*sqrt(2/3))/ls - we*id\"", "the initial state depends on a state or time; it may depend on parameters, inputs and constants", (17, 70), ""),
    ("initial = \"first\" }\niq = { unit = \"A\", derivative = \"(uq - rs*iq - ke*w*sqrt(2/3))/ls - we*id\", initial = \"first\"", "initial = \"steady\" }\niq = { unit = \"A\", derivative = \"(uq - rs*iq - ke*w*sqrt(2/3))/ls - we*id\"", "this state is that of rest, but not `iq`", (17, 70), "write `initial = \"steady\"` at all states, or give each a number or `{ start = ... }`"),
    ("we*iq\", initial = \"first\" }", "we*iq\", initial = \"2*rs\" }", "the first sample gives this state, but not `id`", (18, 87), "write `initial = \"first\"` at all states, or give each a number or `{ start = ... }`"),
    ("we*id\", initial = \"first\"", "we*id\", initial = true", "`initial` is true or false, where a number, an expression, \"first\", \"steady\", \"estimated\" or a table should stand", (18, 87), ""),
    ("id = \"id\"\niq = {", "[solver]\nids = {", "the model has no outputs; say what is measured", (19, 2), ""),
    ("noise = 0.05", "noise = -0.05", "the noise must be finite and not negative", (21, 42), ""),
    ("we*id\", initial = \"first\"", "we*id\", initial = \"first\", initial_noise = \"0.1*w\"", "the initial noise depends on a state, an input or time; it may depend on parameters and constants", (18, 112), ""),
    // Names.
    ("ud - rs*id", "ud - Rs*id", "nothing is called `Rs`", (17, 40), "did you mean `rs`?"),
    ("ud - rs*id", "ud - resistance*id", "nothing is called `resistance`", (17, 40), "declare it under [constants], [inputs], [parameters], [states] or [let]"),
    ("we = \"np*w\"", "we = \"np*wm\"\nwm = \"we/np\"", "`we` is defined by itself: we -> wm -> we", (16, 7), "make it a state, if it has a memory"),
    ("value = 4,", "value = \"4*w\",", "constant `np` depends on a quantity that is not constant", (5, 16), "define it under [let]"),
    ("value = 4,", "value = \"1/0\",", "constant `np` is inf; it must be finite", (5, 16), ""),
    ("sqrt(2/3)", "sqr(2/3)", "there is no function `sqr`", (18, 53), "write `x^2`"),
    ("sqrt(2/3)", "sqrtt(2/3)", "there is no function `sqrtt`", (18, 53), "did you mean `sqrt`?"),
    ("sqrt(2/3)", "sqrt(2, 3)", "`sqrt` takes one argument, not 2", (18, 53), ""),
    ("sqrt(2/3)", "log(2/3)", "there is no function `log`", (18, 53), "write `ln` for the natural logarithm, `log10` for that to base 10"),
    ("sqrt(2/3)", "sqrt", "`sqrt` is a function", (18, 53), "call it with its argument: sqrt(x)"),
    ("ud - rs*id", "ud - rs(id)", "`rs` is no function", (17, 40), "for a product write rs*(...)"),
    ("sqrt(2/3)", "rem_euclid(w, rs)", "the period of `rem_euclid` is not constant", (18, 53), "the period must be a number or a constant"),
    ("sqrt(2/3)", "sin.x(w)", "`sin` is no table", (18, 53), "a slope `.x` is that of a table of [tables]"),
    // Expressions.
    ("np*w", "", "the expression is empty", (15, 7), ""),
    ("np*w", "np*", "the expression ends where a number or a name should follow", (15, 10), ""),
    ("np*w", "np w", "`w` stands where an operator should follow", (15, 10), "write `*` for a product"),
    ("np*w", "2w", "`2w` is neither a number nor a name", (15, 7), "for a product write `2*w`"),
    ("np*w", "(np*w", "this parenthesis is not closed", (15, 7), "add `)`"),
    ("np*w", "np*w)", "`)` stands where an operator should follow", (15, 11), "it closes no parenthesis"),
    ("np*w", "np*1,5", "`,` stands where an operator should follow", (15, 11), "decimals are written with a point: 1.5"),
    ("np*w", "if w == 0 then 1 else 2", "`==` has no meaning here", (15, 12), "numbers are not compared for equality; write `a <= b and b <= a`, or choose a band"),
    ("np*w", "if w then 1 else 2", "this is a number, where a condition should stand", (15, 10), "write a comparison, such as `x > 0`"),
    ("np*w", "if w > 0 then 1", "the expression ends where `else` should follow", (15, 22), "write `if a < b then c else d`: both sides are needed"),
    ("np*w", "np*(w > 0)", "this is true or false, where a number should stand", (15, 10), "write `if ... then 1 else 0`"),
    ("np*w", "if 0 < w < 1 then 1 else 2", "comparisons do not form a chain", (15, 16), "write `a < b and b < c`"),
    ("np*w", "w > 0", "this is true or false, where a number should stand", (15, 7), "write `if ... then 1 else 0`"),
    ("np*w", "np && w", "`&&` has no meaning here", (15, 10), "write `and`"),
    ("np*w", "np*1e999", "`1e999` is beyond the largest number, 1.8e308", (15, 10), ""),
    ("np*w", "np − w", "`−` is a dash", (15, 10), "write the minus sign `-`"),
    ("np*w", "`np*w", "a name in backticks has no end", (15, 7), "close it by `"),
];

#[test]
fn each_mistake_has_its_message() {
    let mut problems = String::new();
    for (from, to, title, place, help) in CASES {
        let text = PMSM.replacen(from, to, 1);
        assert_ne!(text, PMSM, "{from}");
        match Model::named("motor.toml", &text) {
            Ok(_) => problems += &format!("a model:\n{to}\n\n"),
            Err(error) => {
                let remark = &error.remarks()[0];
                let found = (remark.line(), remark.column());
                let is_right =
                    remark.title().starts_with(title) && *place == found && remark.remedy().unwrap_or("") == *help;
                if !is_right {
                    problems += &format!("{to}: {} {found:?} {:?}\n", remark.title(), remark.remedy());
                }
            }
        }
    }
    assert!(problems.is_empty(), "{problems}");
}

/// Of tables: lengths, order, what they do outside.
#[test]
fn each_mistake_in_a_table_has_its_message() {
    let table = |table: &str| format!("greybox = 1\n[inputs]\nu = \"\"\n[tables.f]\n{table}\n[outputs]\ny = \"f(u)\"");
    let surface = "x = [0, 1]\ny = [0, 1]\noutside = \"hold\"\n";
    for (text, title) in [
        ("x = [0, 1]\nvalues = [0, 1]".to_owned(), "table `f` has no `outside`"),
        (
            "x = [0]\nvalues = [0]\noutside = \"hold\"".to_owned(),
            "table `f`: an axis of the table has 1 point(s); give at least two",
        ),
        (
            "x = [1, 0]\nvalues = [0, 1]\noutside = \"hold\"".to_owned(),
            "table `f`: point 1 of an axis of the table is 0, which is not above the point before it; sort the points",
        ),
        ("x = [0, 1]\nvalues = [0]\noutside = \"hold\"".to_owned(), "table `f`: the table has 1 values for 2 points"),
        ("x = [0, 1]\nvalues = [0, 1]\noutside = \"zero\"".to_owned(), "there is no behavior outside `zero`"),
        (
            "x = [0, 1]\nvalues = [0, 1]\nmethod = \"spline\"\noutside = \"hold\"".to_owned(),
            "there is no method `spline`",
        ),
        (
            "x = [0, \"1\"]\nvalues = [0, 1]\noutside = \"hold\"".to_owned(),
            "`x` is a text, where a number should stand",
        ),
        (format!("{surface}values = [[0, 1]]"), "`values` has 1 row(s) for 2 point(s) of `x`; give one list for each"),
        (format!("{surface}values = [[0, 1], [0]]"), "this row has 1 number(s) for 2 point(s) of `y`"),
        (format!("{surface}values = [[0, 1], [0, 1]]"), "`f` takes two arguments, not 1"),
    ] {
        let error = Model::named("model.toml", &table(&text)).unwrap_err();
        assert_eq!(error.remarks()[0].title(), title, "{error}");
    }
    let error = Model::named("model.toml", &table("x = [0, 1]\nvalues = [0, 1]")).unwrap_err();
    let remedy = error.remarks()[0].remedy().unwrap();
    assert!(["outside = \"hold\"", "\"linear\""].iter().all(|value| remedy.contains(value)), "{remedy}");
}

/// All mistakes are shown, each with its line and a caret.
#[test]
fn mistakes_are_shown_together() {
    let text = PMSM.replace("rs*id)", "Rs*id)").replace("we*id", "we*idd");
    let error = Model::named("motor.toml", &text).unwrap_err();
    let expected = "\
error: nothing is called `Rs`
  --> motor.toml:17:40
   |
17 | id = { unit = \"A\", derivative = \"(ud - Rs*id)/ls + we*iq\", initial = \"first\" }
   |                                        ^^
   |
   = help: did you mean `rs`?";
    assert!(error.to_string().starts_with(expected), "{error}");
    assert_eq!(error.remarks().len(), 2);
}

#[test]
fn files_and_names_that_are_not_there() {
    let error = Model::read("no/such.toml").unwrap_err();
    assert!(matches!(error, Error::File { .. }) && error.to_string().starts_with("no/such.toml: "), "{error}");
    let error = Model::shipped("pmsmm").unwrap_err().to_string();
    assert_eq!(error, "there is no model that ships `pmsmm`; did you mean `pmsm`?");
}

/// What a long chain of definitions costs is time, not stack; a circle of any length is found.
#[test]
fn long_chains_of_definitions() {
    let chain = |last: &str| {
        let one = |i: usize| format!("d{i} = \"d{} + 1e-3*d{}\"\n", i + 1, i + 1);
        let all: String = (0..5_000).map(one).collect();
        format!("greybox = 1\n[inputs]\nu = \"\"\n[let]\n{all}d5000 = \"{last}\"\n[outputs]\ny = \"d0\"")
    };
    assert!(Model::named("chain.toml", &chain("u")).is_ok());
    let error = Model::named("chain.toml", &chain("d0")).unwrap_err();
    assert!(error.remarks()[0].title().contains("is defined by itself"));
}

/// Weights and derived quantities have their own names and places.
#[test]
fn expressions_apart() {
    let model: Model = PMSM.parse().unwrap();
    let (graph, root) = model.weight("if abs(w) < 1 then 0 else abs(iq)*np").unwrap();
    let value =
        graph.evaluate::<f64>(&[root], |leaf| if leaf == greybox::graph::Leaf::Measured(1) { -3.0 } else { 5.0 })[0];
    assert_eq!(value, 12.0);
    let error = model.weight("rs*w").unwrap_err();
    assert_eq!(error.remarks()[0].title(), "a weight depends on other things than time, inputs and measured outputs");
    let (graph, root) = model.derived("ls/rs").unwrap();
    assert_eq!(graph.evaluate::<f64>(&[root], |_| 2.0)[0], 1.0);
    let error = model.derived("ls/rr").unwrap_err();
    assert_eq!((error.remarks()[0].title(), error.remarks()[0].column()), ("nothing is called `rr`", 4));
    assert_eq!(model.derived("ls/w").unwrap_err().remarks().len(), 1);
    // What may be used is said, not where to declare it.
    let weight = "a weight may use time, inputs and measured outputs: id, iq, np, t, ud, uq, w";
    let derived = "a derived quantity may use parameters and constants: ke, ls, np, rs";
    for (error, title, help) in [
        (model.weight("foo"), "nothing is called `foo`", weight),
        (model.weight("rs*w"), "a weight depends on other things than time, inputs and measured outputs", weight),
        (model.derived("foo"), "nothing is called `foo`", derived),
        (model.derived("speed"), "nothing is called `speed`", derived),
    ] {
        let error = error.unwrap_err();
        assert_eq!((error.remarks()[0].title(), error.remarks()[0].remedy()), (title, Some(help)));
    }
}
