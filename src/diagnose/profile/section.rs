//! Profiles as a section of a report.

use super::trace::HEIGHT;
use super::{End, Profile, ProfilePoint};
use crate::numeral::{number, percent, resolved, unit_after};
use crate::section::{Axis, Cell, Curves, Drawing, Layer, Plot, Section, Style, Table};

impl From<Vec<Profile>> for Section {
    fn from(profiles: Vec<Profile>) -> Section {
        Section::from(profiles.as_slice())
    }
}

impl From<Profile> for Section {
    fn from(profile: Profile) -> Section {
        Section::from(core::slice::from_ref(&profile))
    }
}

/// The intervals as a table, and the curves beside their quadratic approximations.
impl From<&[Profile]> for Section {
    fn from(profiles: &[Profile]) -> Section {
        let text = "Each curve tells how much worse the fit gets as one unknown is moved and the others are estimated anew. \
                    Where it crosses the dashed line the interval ends; where it never does, the data set no end. The thin \
                    curve is the parabola that a standard error stands for: where the two differ, trust the profile.";
        let columns = ["profile of", "estimate", "unit", "probability", "interval"];
        let row = |profile: &Profile| {
            let Profile { name, unit, value, probability, .. } = profile;
            let value = Cell::resolved(*value, profile.standard_error.unwrap_or(0.0));
            [name.clone().into(), value, unit.as_str().into(), percent(*probability, 4).into(), profile.ends().into()]
        };
        let table = Table::new("Intervals by profile", columns).rows(profiles.iter().map(row));
        let section = Section::new("profiles", "Profiles").says(text).table(table);
        profiles.iter().fold(section, |section, profile| match profile.remark.is_empty() {
            true => section.plot(profile.plot()),
            false => section.plot(profile.plot()).because(profile.severity, profile.remark.clone()),
        })
    }
}

/// A profile is drawn in so many parts between two points.
const PARTS: u32 = 8;

impl Profile {
    /// The interval, and how it ends.
    fn ends(&self) -> String {
        let error = self.standard_error.unwrap_or(0.0);
        let end = |end: End| match end {
            End::At(value) => resolved(value, error),
            End::Bound(value) => format!("{} (bound)", number(value, 6)),
            End::Open(value) => format!("open beyond {}", number(value, 3)),
        };
        format!("{} … {}", end(self.lower), end(self.upper))
    }

    fn plot(&self) -> Plot {
        // Between points the signed root of the rise is next to straight.
        let root = |point: &ProfilePoint| (point.value, point.rise.sqrt().copysign(point.value - self.value));
        let roots: Vec<(f64, f64)> = self.points.iter().map(root).collect();
        let between = |pair: &[(f64, f64)]| {
            let ((a, low), (b, high)) = (pair[0], pair[1]);
            (0..=PARTS).map(f64::from).map(move |i| i / f64::from(PARTS)).map(move |part| {
                let root = low + part * (high - low);
                (a + part * (b - a), root * root)
            })
        };
        let height = HEIGHT * self.threshold;
        let curve: Vec<(f64, f64)> = roots.windows(2).flat_map(between).filter(|(_, rise)| *rise <= height).collect();
        let label = format!("{} threshold", percent(self.probability, 4));
        let mut layers = vec![Layer::Level { value: self.threshold, label }];
        layers.extend(self.quadratic(&curve).map(|points| Layer::Line { style: Style::Quiet, points }));
        layers.push(Layer::Line { style: Style::Main, points: curve });
        layers.push(Layer::Mark { value: self.value, label: "estimate".to_owned() });
        let drawing = Curves {
            x: Axis::new(&self.name, &self.unit),
            y: Axis::new("rise of -2 ln L", "").from(0.0).to(height),
            layers,
        };
        let title = format!(
            "Profile of {}: rise of the deviance as it is moved, the others refitted; beside it the parabola of its standard \
             error",
            self.name
        );
        let caption = format!("`{}`: {}{}", self.name, self.ends(), unit_after(&self.unit));
        Plot::of(format!("profile-{}", self.name), caption, title, Drawing::Curves(drawing))
    }

    /// The quadratic approximation over what the curve spans.
    fn quadratic(&self, curve: &[(f64, f64)]) -> Option<Vec<(f64, f64)>> {
        const POINTS: u32 = 64;
        let error = self.standard_error? / self.transform.slope(self.value).abs();
        let ((first, _), (last, _)) = (*curve.first()?, *curve.last()?);
        let coordinate = |value: f64| self.transform.to_coordinate(value);
        let point = |i: u32| {
            let value = first + (last - first) * f64::from(i) / f64::from(POINTS);
            (value, ((coordinate(value) - coordinate(self.value)) / error).powi(2))
        };
        let height = HEIGHT * self.threshold;
        Some((0..=POINTS).map(point).filter(|(_, rise)| *rise <= height).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameter::Transform;
    use crate::severity::Severity;

    /// Of a parabola, both curves are that parabola, from end to end and as far as the drawing is high; the interval's ends and the
    /// levels stand beside it.
    #[test]
    fn a_parabola_is_drawn_as_one() {
        let rise = |value: f64| ((value - 1.0) / 0.1).powi(2);
        let point = |k: i32| ProfilePoint {
            value: 1.025 + 0.05 * f64::from(k),
            rise: rise(1.025 + 0.05 * f64::from(k)),
            unknowns: vec![],
        };
        let profile = Profile {
            name: "rs".to_owned(),
            unit: "ohm".to_owned(),
            value: 1.0,
            probability: 0.95,
            lower: End::At(0.804),
            upper: End::Bound(1.196),
            standard_error: Some(0.1),
            transform: Transform::Identity,
            points: (-5..=4).map(point).collect(),
            threshold: 3.84,
            inflation: 1.0,
            severity: Severity::Usable,
            remark: String::new(),
        };
        assert_eq!(profile.ends(), "0.80 … 1.196 (bound)");
        let Some(Drawing::Curves(curves)) = profile.plot().drawing else { panic!() };
        let lines: Vec<&Vec<(f64, f64)>> = curves
            .layers
            .iter()
            .filter_map(|layer| match layer {
                Layer::Line { points, .. } => Some(points),
                _ => None,
            })
            .collect();
        assert_eq!(lines.len(), 2);
        for line in lines {
            assert!(
                line.len() > 60 && line.iter().all(|(value, drawn)| (drawn - rise(*value)).abs() < 1e-9),
                "{line:?}"
            );
            let (first, last) = (line[0].0, line[line.len() - 1].0);
            // The drawing is 1.5 times 3.84 high, which is at 0.24 to either side; the last points are 0.225 away.
            assert!((first - 0.775).abs() < 1e-9 && (last - 1.225).abs() < 1e-9, "{first} {last}");
        }
        let quadratic = Profile { standard_error: Some(0.2), ..profile };
        let drawn = quadratic.quadratic(&[(0.8, 4.0), (1.2, 4.0)]).unwrap();
        assert!(drawn.iter().all(|(value, drawn)| (drawn - rise(*value) / 4.0).abs() < 1e-9), "{drawn:?}");
        // Of an unknown that was estimated by its logarithm, a parabola in that: a standard error of 0.2 at 2 is one of 0.1 there.
        let logarithm = Profile { value: 2.0, transform: Transform::Log, ..quadratic.clone() };
        let in_logarithm = logarithm.quadratic(&[(1.7, 4.0), (2.4, 4.0)]).unwrap();
        let is_square = |(value, drawn): &(f64, f64)| (drawn - ((value / 2.0).ln() / 0.1).powi(2)).abs() < 1e-9;
        assert!(in_logarithm.len() == 65 && in_logarithm.iter().all(is_square), "{in_logarithm:?}");
        // 65 points, evenly from the first to the last of the curve.
        let even = |i: usize| (drawn[i].0 - (0.8 + 0.4 * i as f64 / 64.0)).abs() < 1e-12;
        assert!(drawn.len() == 65 && (0..65).all(even), "{drawn:?}");
    }
}
