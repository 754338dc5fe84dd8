//! Remedies in the words of the package: the library names its own functions.

use greybox::text::renamed;

/// Functions of the library, and the arguments that do the same, with what they are given; `errors.py` has those whose
/// arguments stand elsewhere in the sentence. Of names of which one begins with the other, the longer one stands first.
const NAMES: &[(&str, &str)] = &[
    (", filter the restarts (Horizon::filtered), or take", ", or take"),
    (", or the `derivative` or `next` that Model::KIND asks for was not written", ""),
    ("take the predictor Kalman or SecondOrder", "take predictor=\"kalman\" or \"second-order\""),
    ("take the predictor Kalman", "take predictor=\"kalman\""),
    ("take Kalman, with", "take predictor=\"kalman\", with"),
    ("use Kalman with", "use predictor=\"kalman\" with"),
    ("InitialCovariance::FirstInterval (kalman:first-interval)", "predictor=\"kalman:first-interval\""),
    ("take Esdirk, or", "take integrator=\"esdirk\", or"),
    ("(Horizon)", "(predictor=\"horizon:1\")"),
    ("(Kalman)", "(predictor=\"kalman\")"),
    ("FreeRun", "predictor=\"simulation\""),
    ("SecondOrder", "predictor=\"second-order\""),
    (".within(0.0, ..)", "within=(0, ...)"),
    ("free(..).log()", "log=True"),
    (".log()", "log=True"),
    (".per_experiment()", "per_experiment=True"),
    (".positive()", "positive=True"),
    ("say how many seconds one is by DataFile::factor(\"t\", ..)", "give a frame with a column `t` of seconds"),
    ("DataFile::column", "columns={\"signal\": \"column\"}, or time=\"column\""),
    ("DataFile::dates", "pandas.to_datetime and its dayfirst"),
    ("DataFile::decimal_comma", "decimal=\",\" of pandas.read_csv"),
    ("DataFile::delimiter", "sep of pandas.read_csv"),
    ("DataFile::fill, Record::from_series", "gb.align"),
    ("DataFile::fill", "gb.align"),
    ("DataFile::offset", "an offset"),
    ("DataFile::reversed turns a sign", "turn a sign in the model"),
    ("DataFile::reversed", "a turned sign"),
    ("DataFile::sample_time", "sample_time"),
    ("DataFile::units_row", "skiprows of pandas.read_csv"),
    ("DataFile::zone", "tz_localize of pandas"),
    ("(`Experiment::between`)", "(a part of the frame)"),
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
    ("Record::decimate", "a frame of fewer rows"),
    ("diagnose::profile", "Fit.profile"),
    ("initial_from_first_sample", "initial=\"first\""),
];

/// A text of the library with arguments of the package in place of its functions.
pub fn in_python(text: &str) -> String {
    // Markdown has underscores escaped.
    let escaped = |text: &str| text.replace('_', "\\_");
    let markdown = NAMES.iter().filter(|(theirs, _)| theirs.contains('_'));
    let markdown: Vec<(String, String)> = markdown.map(|(theirs, ours)| (escaped(theirs), escaped(ours))).collect();
    let markdown: Vec<(&str, &str)> = markdown.iter().map(|(theirs, ours)| (theirs.as_str(), ours.as_str())).collect();
    renamed(&renamed(text, NAMES), &markdown)
}
