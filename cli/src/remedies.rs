//! Remedies in the words of the command line: the library names its own functions.

use greybox::text::renamed;

/// Functions of the library, and the options that do the same, with what they are given.
const NAMES: [(&str, &str); 22] = [
    ("DataFile::factor(\"t\", ..)", "--time-unit"),
    ("DataFile::column", "--column {}"),
    ("DataFile::dates", "--date-order"),
    ("DataFile::factor", "--unit {}"),
    ("DataFile::fill, Record::from_series", "--fill"),
    ("DataFile::fill", "--fill {}"),
    ("DataFile::sample_time", "--sample-time {}"),
    ("DataFile::unit", "--unit {}"),
    ("DataFile::zone", "--zone {}"),
    ("Experiment::between", "--between {}"),
    ("Experiment::initial", "--initial {}"),
    ("Experiment::slice", "--between {}"),
    ("Fit::integrator", "--integrator {}"),
    ("Fit::noise_covariance", "--noise-covariance"),
    ("Fit::staged", "--staged"),
    ("Fit::starts", "--starts {}"),
    ("Fit::weighting", "--weight {}"),
    ("Model::diffusion", "`diffusion`"),
    ("Model::initial_noise", "`initial_noise`"),
    ("Model::noise", "`noise`"),
    ("Parameter::per_experiment", "--per-record"),
    ("initial_from_first_sample", "--initial first"),
];

/// A text of the library with the options of the command in place of its functions.
pub fn in_shell(text: &str) -> String {
    renamed(text, &NAMES)
}

#[cfg(test)]
mod tests {
    use super::in_shell;

    #[test]
    fn remedies_are_options() {
        for (theirs, ours) in [
            ("give DataFile::factor(\"w\", 0.1047), or 1 if", "give --unit w=0.1047, or 1 if"),
            ("seconds one is by DataFile::factor(\"t\", ..)", "seconds one is by --time-unit"),
            ("looks for it: Fit::starts(32)", "looks for it: --starts 32"),
            ("an end (Fit::starts), which; Fit::staged", "an end (--starts), which; --staged"),
            ("by DataFile::zone (\"Europe/Berlin\")", "by --zone (\"Europe/Berlin\")"),
            ("its rate (DataFile::fill, Record::from_series)", "its rate (--fill)"),
            ("nothing of the library", "nothing of the library"),
        ] {
            assert_eq!(in_shell(theirs), ours);
        }
    }
}
