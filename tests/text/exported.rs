//! Texts that are written as Rust: the code in `tests/text/exported` is what is written, compiles, and says the same.
//! `GREYBOX_WRITE_EXPORTS=1 cargo test --test text exported` writes it.

use crate::twins::values;
use approx::assert_relative_eq;
use greybox::Signals;
use greybox::equations::Equations;
use greybox::text::Model;

macro_rules! exported {
    ($($name:ident: $type:ident;)*) => {
        $(#[allow(dead_code, clippy::all)]
        mod $name {
            include!(concat!("exported/", stringify!($name), ".rs"));
        })*

        #[test]
        fn code_is_up_to_date_and_says_the_same() {
            $({
                let text = Model::shipped(stringify!($name)).unwrap();
                let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/text/exported/", stringify!($name), ".rs");
                let code = text.to_rust().unwrap();
                if std::env::var_os("GREYBOX_WRITE_EXPORTS").is_some() {
                    std::fs::write(path, &code).unwrap();
                }
                assert_eq!(std::fs::read_to_string(path).unwrap(), code);
                same(&text, $name::$type::default(), $name::$type::parameters());
            })*
        }
    };
}

exported! {
    pmsm: PmsmWithSurfaceMagnets;
    exact_surface: PmsmWithSurfaceMagnetsInExactSteps;
    positioning_loop: LinearAxisUnderItsController;
    flux_mapped: PmsmWithAFluxMap;
}

/// Names, units, declarations, and values to a few roundings.
fn same<M: greybox::Model>(text: &Model, model: M, parameters: greybox::Of<M::Parameters, greybox::Parameter>) {
    let traced = Equations::trace(&model).unwrap();
    assert_eq!(traced.layout(), text.equations().layout());
    assert_eq!(M::Parameters::into_array(parameters).as_ref(), text.parameters());
    for seed in 0..20 {
        for (found, expected) in values(&traced, seed).into_iter().zip(values(text.equations(), seed)) {
            assert_relative_eq!(found, expected, max_relative = 1e-12, epsilon = 1e-12);
        }
    }
}
