//! The unknowns on the page: their intervals, what tells them apart, profiles, refits.

use super::super::markup::Markup;
use super::super::{Report, plots, tables, words};
use super::{figure, list, section, sentence, table};

pub(super) fn parameters(main: &mut Markup, report: &Report) {
    section(main, "Parameters", |section| {
        section.node("div", &[("class", &"pair table-first")], |pair| {
            table(pair, "Estimates", "cards", &tables::parameters(report));
            plots::parameters(report).iter().for_each(|plot| figure(pair, plot, "Intervals beside each other"));
        });
        table(section, "Outputs", "cards", &tables::outputs(report));
    });
}

pub(super) fn identifiability(main: &mut Markup, report: &Report) {
    section(main, "What the data tell apart", |section| {
        section.node("div", &[("class", &"pair")], |pair| {
            pair.node("div", &[], |column| {
                column.words("p", &[], words::rank(report));
                list(column, &report.identifiability.advice);
                let strong = words::correlated(report);
                match strong.is_empty() {
                    true => column.words("p", &[], "No two estimates are correlated by more than 0.95."),
                    false => {
                        column.words("p", &[], "Strongly correlated estimates, known better together than alone:");
                        list(column, &strong);
                    }
                }
            });
            plots::correlation(report).iter().for_each(|plot| figure(pair, plot, "Correlation of the estimates"));
        });
        section.node("div", &[("class", &"pair")], |pair| {
            table(pair, "Excitation", "cards", &tables::excitation(report));
            let tenths = match report.records.len() {
                1 => "Part of each unknown's information (%) from each tenth of the record",
                _ => "Part of each unknown's information from each tenth of the records, in their order",
            };
            plots::excitation(report).iter().for_each(|plot| figure(pair, plot, tenths));
        });
    });
}

pub(super) fn profiles(main: &mut Markup, report: &Report) {
    if report.profiles.is_empty() {
        return;
    }
    section(main, "Profiles", |section| {
        let text = "Each curve tells how much worse the fit gets as one unknown is moved and the others are estimated \
                    anew. Where it crosses the dashed line the interval ends; where it never does, the data set no end.";
        section.words("p", &[], text);
        section.node("div", &[("class", &"panels")], |panels| {
            for profile in &report.profiles {
                let caption = format!("{}: {} {}", profile.name, tables::ends(profile), profile.unit);
                figure(panels, &plots::profile(profile), caption.trim_end());
            }
        });
        table(section, "Intervals by profile", "cards", &tables::profiles(report));
    });
}

pub(super) fn refits(main: &mut Markup, report: &Report) {
    if report.bootstrap.is_none() && report.restarts.is_none() {
        return;
    }
    section(main, "Refits", |section| {
        if let Some(found) = &report.restarts {
            let text = format!("From {} other starts: {}.", found.tried, found.meaning);
            section.node("p", &[], |p| sentence(p, &text));
        }
        if let Some(found) = &report.bootstrap {
            table(section, &words::refits(found), "cards", &tables::bootstrap(found));
        }
    });
}
