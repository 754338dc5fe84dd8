//! Units flow through expressions; what does not fit is a warning, with both dimensions.

use crate::meaning::{PMSM, model};

/// The titles of the warnings of a motor whose first equation is changed.
fn warnings(from: &str, to: &str) -> Vec<String> {
    assert!(PMSM.contains(from));
    model(&PMSM.replacen(from, to, 1)).warnings().iter().map(|warning| warning.title().to_owned()).collect()
}

#[test]
fn sums_of_other_dimensions() {
    assert_eq!(warnings("ud - rs*id)", "ud - rs*w)"), ["`ud` is in V, `rs*w` is in ohm/s"]);
    assert_eq!(warnings("/ls + we*iq", "/ls + iq"), ["`(ud - rs*id)/ls` is in A/s, `iq` is in A"]);
    let product = ["`(ud - rs*id)*ls` is in kg^2 m^4/(A^3 s^5), `we*iq` is in A/s"];
    assert_eq!(warnings("(ud - rs*id)/ls + we*iq", "(ud - rs*id)*ls + we*iq"), product);
    let whole = ["the derivative of `id` is in A/s, this is in V"];
    assert_eq!(warnings("(ud - rs*id)/ls + we*iq", "ud - rs*id"), whole);
    assert_eq!(warnings("(ud - rs*id)", "(if w > ud then ud else uq)"), ["`w` is in 1/s, `ud` is in V"]);
    assert_eq!(warnings("we*iq", "we*iq*exp(ud)"), ["`exp` takes a number without a unit, this is in V"]);
    let noise = ["the initial noise of `id` is in A, this is in ohm"];
    assert_eq!(warnings("initial = \"first\" }", "initial = \"first\", initial_noise = \"rs\" }"), noise);
    // Numbers fit any unit, and a factor may convert.
    assert!(warnings("ud - rs*id)", "ud + 1 - 2*rs*id)").is_empty());
    assert!(warnings("ud - rs*id)", "max(ud, 0) - hypot(rs*id, 1e-3) + sqrt(uq^2))").is_empty());
}

#[test]
fn sizes_are_not_converted() {
    assert_eq!(warnings("uq = \"V\"", "uq = \"mV\""), ["`uq` is in units of 0.001 V, `rs*iq` of V"]);
    assert!(model(&PMSM.replace("uq = \"V\"", "uq = \"mV\"").replace("(uq -", "(1e-3*uq -")).warnings().is_empty());
    let rpm = warnings("w = \"rad/s\"", "w = \"rpm\"");
    assert!(rpm.iter().any(|title| title.contains("0.10472 A/s")), "{rpm:?}");
    let angle = "greybox = 1\n[inputs]\na = \"deg\"\n[outputs]\ny = { value = \"sin(a)\", unit = \"1\" }";
    let said: Vec<_> = model(angle).warnings().iter().map(|warning| warning.title().to_owned()).collect();
    assert_eq!(said, ["`sin` takes radians or a ratio, this is in units of 0.0174533 1"]);
}

/// A symbol that is not known is named once, with its place; what depends on it is not checked. A declared one is checked.
#[test]
fn own_symbols() {
    let text =
        "greybox = 1\n[inputs]\na = \"glorp\"\nb = \"V glorp\"\n[outputs]\ny = { value = \"a + b\", unit = \"V\" }";
    let unknown = model(text);
    assert_eq!(unknown.warnings().len(), 1);
    assert_eq!((unknown.warnings()[0].title(), unknown.warnings()[0].line()), ("unit `glorp` is not known", 3));
    let declared = model(&text.replace("[inputs]", "[units]\nglorp = \"\"\n[inputs]"));
    let said: Vec<_> = declared.warnings().iter().map(|warning| warning.title()).collect();
    assert_eq!(
        said,
        ["`a` is in glorp, `b` is in A^-1 glorp kg m^2 s^-3"]
            .map(|_| "`a` is in glorp, `b` is in glorp kg m^2/(A s^3)")
    );
    let by_others = text.replace("[inputs]", "[units]\nglorp = \"1e-3 V\"\n[inputs]").replace("V glorp", "V");
    assert_eq!(model(&by_others).warnings()[0].title(), "`a` is in units of 0.001 V, `b` of V");
}

/// The caret stands below the operation, also in a string of several lines.
#[test]
fn a_warning_shows_the_place() {
    let text = PMSM.replacen("\"(ud - rs*id)/ls + we*iq\"", "\"\"\"\n  (ud - rs*w)/ls\n  + we*iq\"\"\"", 1);
    let shown = model(&text).warnings()[0].to_string();
    let expected = "\
warning: `ud` is in V, `rs*w` is in ohm/s
  --> model.toml:18:4
   |
18 |   (ud - rs*w)/ls
   |    ^^^^^^^^^";
    assert_eq!(shown, expected);
}
