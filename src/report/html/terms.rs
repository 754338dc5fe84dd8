//! Words that not every reader knows, explained where they stand.

/// A term: its name for the page, the words it is met under, and what it means.
pub(super) struct Term {
    pub id: &'static str,
    words: &'static [&'static str],
    pub meaning: &'static str,
}

impl Term {
    /// The heading of its explanation.
    pub fn name(&self) -> String {
        self.words.join(", ")
    }
}

/// The terms of a report.
pub(super) const TERMS: [Term; 20] = [
    Term {
        id: "error-index",
        words: &["error index"],
        meaning: "The relative change of a parameter that doubles the sum of squared errors, the others estimated anew, in \
                  linear approximation. A low index stands for a parameter that the record shows well.",
    },
    Term {
        id: "standard-error",
        words: &["std. error", "standard error", "standard errors"],
        meaning: "The standard deviation that the estimate would have over many records made under the same conditions.",
    },
    Term {
        id: "interval",
        words: &["95 % interval"],
        meaning: "Made again and again from new records, such intervals hold the true value in 95 of 100 cases, if the model \
                  is right.",
    },
    Term {
        id: "fit",
        words: &["fit"],
        meaning: "100 % less the norm of the error relative to the norm of the output about its mean. 100 % is perfect, 0 % is \
                  no better than the mean.",
    },
    Term {
        id: "rms",
        words: &["rms error"],
        meaning: "The root of the mean squared difference of measured and predicted.",
    },
    Term {
        id: "noise",
        words: &["noise"],
        meaning: "The standard deviation of the errors, given or estimated with the degrees of freedom taken into account.",
    },
    Term {
        id: "cosine",
        words: &["gradient cosine"],
        meaning: "The cosine of the angle between the residuals and the nearest column of the slopes. It is zero at a minimum, \
                  whatever the units.",
    },
    Term {
        id: "hac",
        words: &["HAC"],
        meaning: "A covariance that allows for errors that are correlated over time and of changing size (heteroscedasticity \
                  and autocorrelation consistent; Newey and West 1987). It allows for colored noise, not for a wrong model.",
    },
    Term {
        id: "prewhitened",
        words: &["prewhitened"],
        meaning: "Before the correlations are summed, an autoregression takes out most of them, and is put back after, so that \
                  few lags suffice (Andrews and Monahan 1992).",
    },
    Term {
        id: "sandwich",
        words: &["sandwich"],
        meaning: "A covariance from the scatter of the errors as they are, for weighted and robust fits (Huber, White).",
    },
    Term { id: "white", words: &["white"], meaning: "Each error is independent of those before it." },
    Term {
        id: "ljung-box",
        words: &["Ljung-Box"],
        meaning: "A test of whether residuals are white, by the sum of their squared autocorrelations over many lags.",
    },
    Term {
        id: "probability",
        words: &["probability"],
        meaning: "How likely such a result, or one further out, would be if nothing were wrong. A test fails below 0.01.",
    },
    Term {
        id: "condition",
        words: &["condition number"],
        meaning: "The largest over the smallest singular value of the sensitivities, each scaled to unit length. Beyond a few \
                  hundred some unknowns can hardly be told apart.",
    },
    Term {
        id: "strength",
        words: &["σ of noise per 1 %"],
        meaning: "How far the outputs move, in standard deviations of the noise over the whole record, if the unknown changes by \
                  1 %. Below a few it is hardly seen.",
    },
    Term {
        id: "log-likelihood",
        words: &["log-likelihood", "ln L"],
        meaning: "The logarithm of the likelihood; where variances are predicted and a loss was asked for, with the loss of each error in place \
                  of half its square.",
    },
    Term {
        id: "deviance",
        words: &["deviance", "-2 ln L"],
        meaning: "-2 times the logarithm of the likelihood. Differences of it between nested models are chi-squared.",
    },
    Term {
        id: "criteria",
        words: &["AIC", "AICc", "BIC"],
        meaning: "The deviance and a penalty for each parameter (Akaike; corrected for short records; Bayes). Of models fitted \
                  to the same data the one with the least is preferred.",
    },
    Term {
        id: "fpe",
        words: &["final prediction error"],
        meaning: "The error variance to expect on new data (Akaike).",
    },
    Term {
        id: "passes",
        words: &["passes with slopes"],
        meaning: "How often the model was run over all records together with its derivatives to the unknowns.",
    },
];

/// The first term in a text, by the byte it begins at and its words as they stand; of those that begin together, the
/// longest. `known` are left out.
pub(super) fn first<'a>(text: &'a str, known: &[&str]) -> Option<(usize, &'a str, &'static Term)> {
    let mut found: Option<(usize, &str, &Term)> = None;
    for term in TERMS.iter().filter(|term| !known.contains(&term.id)) {
        for words in term.words {
            let at = text.match_indices(words).map(|(at, _)| at).find(|at| alone(text, *at, words.len()));
            if let Some(at) = at.filter(|at| {
                found.is_none_or(|(other, longest, _)| *at < other || *at == other && words.len() > longest.len())
            }) {
                found = Some((at, &text[at..at + words.len()], term));
            }
        }
    }
    found
}

/// Whether words stand for themselves, not within others.
fn alone(text: &str, at: usize, length: usize) -> bool {
    let part = |letter: char| letter.is_alphanumeric() || letter == '-';
    !text[..at].chars().next_back().is_some_and(part) && !text[at + length..].chars().next().is_some_and(part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_are_found_as_words() {
        let at = |text| first(text, &[]).map(|(at, words, term)| (at, words, term.id));
        assert_eq!(at("HAC over 3 lags, prewhitened"), Some((0, "HAC", "hac")));
        assert_eq!(at("a fitted outfit"), None);
        assert_eq!(at("95 % interval"), Some((0, "95 % interval", "interval")));
        assert_eq!(first("white or HAC", &["white"]).map(|found| found.1), Some("HAC"));
        // Names are unique, or a page would explain one by another.
        let mut ids: Vec<&str> = TERMS.iter().map(|term| term.id).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), TERMS.len());
    }
}
