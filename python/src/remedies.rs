//! Remedies in the words of the package: the library names its own functions.

use greybox::text::renamed;

/// Functions of the library, and the arguments that do the same, with what they are given.
const NAMES: [(&str, &str); 14] = [
    ("DataFile::fill, Record::from_series", "gb.align"),
    ("Experiment::between", "a part of the frame"),
    ("Experiment::initial", "initial={}"),
    ("Experiment::slice", "a slice"),
    ("Experiment::without_gaps", "a record of each"),
    ("Fit::integrator", "integrator={}"),
    ("Fit::noise_covariance", "noise=\"covariance\""),
    ("Fit::staged", "staged=True"),
    ("Fit::starts", "starts={}"),
    ("Fit::weighting", "weighting"),
    ("Model::", "Model."),
    ("Parameter::per_experiment", "per_experiment=True"),
    ("initial_from_first_sample", "initial=\"first\""),
    ("free(..).log()", "log=True"),
];

/// A text of the library with arguments of the package in place of its functions.
pub fn in_python(text: &str) -> String {
    renamed(text, &NAMES)
}
