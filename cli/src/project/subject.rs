//! What an option is about: one of the command line takes the place of what the project says of the same.

use clap::{Arg, ArgAction};

/// Options of which one has no effect, or no meaning, beside the other.
const CONTRARY: [(&str, &str); 12] = [
    ("fix", "free"),
    ("fix", "set"),
    ("fix", "bounds"),
    ("fix", "prior"),
    ("fix", "log"),
    ("fix", "per-record"),
    ("noise", "noise-covariance"),
    ("staged", "multiple-shooting"),
    ("column", "sample-time"),
    ("unit", "sample-time"),
    ("date-order", "sample-time"),
    ("zone", "sample-time"),
];

/// Lists that are said as a whole; of others each name is said by itself.
const WHOLE: [&str; 2] = ["of", "validation"];

#[derive(Debug)]
pub struct Subject {
    option: String,
    /// Of which parameter, signal or state; `None` of all.
    name: Option<String>,
}

impl Subject {
    /// That of an option with this value.
    pub fn new(option: &Arg, value: &str) -> Self {
        let long = option.get_long().unwrap_or_default();
        let (long, name) = match (long, value) {
            ("time", _) => ("column", Some("t")),
            ("time-unit", _) => ("unit", Some("t")),
            ("sample-time", _) => (long, Some("t")),
            ("initial", "first" | "steady") => (long, None),
            _ if WHOLE.contains(&long) => (long, None),
            _ if matches!(option.get_action(), ArgAction::Append) => (long, value.split(['=', '~']).next()),
            _ => (long, None),
        };
        Subject { option: long.to_owned(), name: name.map(|name| name.trim().to_owned()) }
    }

    /// Whether both are about the same.
    pub fn meets(&self, other: &Self) -> bool {
        let options = (self.option.as_str(), other.option.as_str());
        let of_option =
            options.0 == options.1 || CONTRARY.iter().any(|pair| *pair == options || *pair == (options.1, options.0));
        let of_name = self.name.is_none() || other.name.is_none() || self.name == other.name;
        of_option && of_name
    }
}

#[cfg(test)]
mod tests {
    use super::Subject;
    use crate::arguments::Arguments;
    use clap::CommandFactory;

    fn meet(one: (&str, &str), other: (&str, &str)) -> bool {
        let command = Arguments::command();
        let options: Vec<_> = command.get_subcommands().flat_map(|one| one.get_arguments()).collect();
        let subject = |(long, value): (&str, &str)| {
            Subject::new(options.iter().find(|option| option.get_long() == Some(long)).unwrap(), value)
        };
        let [there, back] = [(one, other), (other, one)].map(|(one, other)| subject(one).meets(&subject(other)));
        assert_eq!(there, back);
        there
    }

    #[test]
    fn options_are_about_parameters_signals_and_states() {
        for (one, other) in [
            (("fix", "ls=2e-3"), ("free", "ls")),
            (("fix", "ls=2e-3"), ("set", " ls = 1e-3")),
            (("initial", "steady"), ("initial", "id~0")),
            (("initial", "id=0"), ("initial", "id~0")),
            (("noise", "id=1"), ("noise-covariance", "true")),
            (("staged", "true"), ("multiple-shooting", "true")),
            (("time", "Time"), ("sample-time", "1e-3")),
            (("column", "t=Time"), ("sample-time", "1e-3")),
            (("time-unit", "ms"), ("sample-time", "1e-3")),
            (("unit", "t=0.001"), ("sample-time", "1e-3")),
            (("time-unit", "ms"), ("unit", "t=s")),
            (("zone", "Europe/Berlin"), ("sample-time", "1e-3")),
            (("date-order", "day"), ("sample-time", "1e-3")),
            (("time", "Time"), ("column", "t=Zeit")),
            (("loss", "huber"), ("loss", "cauchy")),
            (("of", "rs"), ("of", "ls")),
        ] {
            assert!(meet(one, other), "{one:?} {other:?}");
        }
        for (one, other) in [
            (("fix", "ls=2e-3"), ("free", "rs")),
            (("free", "rs"), ("set", "rs=1")),
            (("noise", "id=1"), ("noise", "iq=1")),
            (("initial", "id=0"), ("initial", "iq=0")),
            (("column", "w=speed"), ("sample-time", "1e-3")),
            (("unit", "w=rpm"), ("sample-time", "1e-3")),
            (("time-unit", "ms"), ("unit", "w=rpm")),
            (("loss", "huber"), ("starts", "20")),
        ] {
            assert!(!meet(one, other), "{one:?} {other:?}");
        }
    }
}
