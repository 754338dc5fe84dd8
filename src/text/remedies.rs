//! [`renamed`]: sentences of the library in the words of a front end.

/// A sentence, such as that of an error or a warning, in which functions of the library have the names of a front end. In these, what the function
/// is given stands for `{}`, which is left out with the space or equals sign before it where the sentence names the function alone.
///
/// ```
/// use greybox::text::renamed;
///
/// let names = [("Fit::starts", "--starts {}"), ("DataFile::factor", "--unit {}")];
/// assert_eq!(renamed("ask for more starts (Fit::starts)", &names), "ask for more starts (--starts)");
/// assert_eq!(renamed("look for it: Fit::starts(32)", &names), "look for it: --starts 32");
/// assert_eq!(renamed("give DataFile::factor(\"w\", 0.1), or 1", &names), "give --unit w=0.1, or 1");
/// assert_eq!(renamed("see DataFile::factors", &names), "see DataFile::factors"); // of another name
/// ```
pub fn renamed(text: &str, names: &[(&str, &str)]) -> String {
    names.iter().fold(text.to_owned(), |text, (function, name)| {
        let (alone, takes) =
            name.split_once("{}").map_or((*name, false), |(before, _)| (&before[..before.len() - 1], true));
        let mut pieces = text.split(function);
        let mut found = pieces.next().unwrap_or_default().to_owned();
        for piece in pieces {
            // Another function, whose name begins with this one.
            if function.ends_with(char::is_alphanumeric) && piece.starts_with(|c: char| c.is_alphanumeric() || c == '_')
            {
                found.extend([function, piece]);
                continue;
            }
            match arguments(piece).filter(|_| takes) {
                Some((given, rest)) => found.extend([&name.replace("{}", &given), rest]),
                None => found.extend([alone, piece]),
            }
        }
        found
    })
}

/// What a function is given, in parentheses that follow it at once, and the text behind them.
fn arguments(text: &str) -> Option<(String, &str)> {
    let (inside, rest) = text.strip_prefix('(')?.split_once(')')?;
    let given: Vec<&str> = inside.split(", ").map(|one| one.trim_matches('"')).collect();
    Some((given.join("="), rest))
}
