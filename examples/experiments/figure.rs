//! Figures as SVG files: panels of curves that are told apart by color and marker, and a caption that says what to see.

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use std::path::Path;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Result = core::result::Result<(), Box<dyn std::error::Error>>;

/// One file: panels side by side that share legend and axis labels.
pub struct Figure {
    /// Of the file.
    pub name: String,
    pub title: String,
    /// What to see in it.
    pub caption: String,
    pub x: &'static str,
    pub y: &'static str,
    pub panels: Vec<Panel>,
    /// Whether the vertical axis is logarithmic.
    pub logarithmic: bool,
}

pub struct Panel {
    pub title: String,
    pub series: Vec<Series>,
}

#[derive(Clone)]
pub struct Series {
    pub label: String,
    pub points: Vec<(f64, f64)>,
    pub kind: Kind,
}

#[derive(Clone, Copy, PartialEq)]
pub enum Kind {
    /// A line, with markers where a panel has several.
    Curve,
    /// Markers only: what the horizontal axis counts has no order.
    Points,
    /// A value to compare with: dashed, gray, without markers.
    Reference,
}

/// A curve; it is broken where a point is not a number.
pub fn curve(label: impl Into<String>, points: Vec<(f64, f64)>) -> Series {
    Series { label: label.into(), points, kind: Kind::Curve }
}

/// Markers without a line.
pub fn dots(label: impl Into<String>, points: Vec<(f64, f64)>) -> Series {
    Series { label: label.into(), points, kind: Kind::Points }
}

/// What it is to be compared with.
pub fn reference(label: impl Into<String>, points: Vec<(f64, f64)>) -> Series {
    Series { label: label.into(), points, kind: Kind::Reference }
}

/// A constant to compare with, from `x.0` to `x.1`.
pub fn level(label: impl Into<String>, value: f64, x: (f64, f64)) -> Series {
    reference(label, vec![(x.0, value), (x.1, value)])
}

/// Every n-th of a long series, so that about 1,500 points are left.
pub fn thin(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let step = points.len().div_ceil(1500).max(1);
    points.into_iter().step_by(step).collect()
}

/// Told apart by color-blind eyes (Okabe and Ito), and dark enough on white.
const COLORS: [RGBColor; 5] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 120, 20),
];
const REFERENCES: [RGBColor; 2] = [RGBColor(60, 60, 60), RGBColor(150, 150, 150)];

const WIDTH: u32 = 1100;
const LETTERS: u32 = 17;
/// Markers on a curve of many points.
const MARKERS: usize = 11;

/// A number to so many digits, without zeros behind the point.
fn short(value: f64, digits: i32) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = (digits - 1 - value.abs().log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

impl Figure {
    /// Draws the figure as `name.svg` into a folder.
    pub fn draw(&self, folder: &Path) -> Result {
        let columns = match self.panels.len() {
            1 => 1,
            2 | 4 => 2,
            _ => 3,
        };
        let rows = self.panels.len().div_ceil(columns);
        let height = if columns == 1 { 470 } else { 330 * rows as u32 };
        let path = folder.join(format!("{}.svg", self.name));
        let root = SVGBackend::new(&path, (WIDTH, height + 90)).into_drawing_area();
        root.fill(&WHITE)?;
        root.draw(&Text::new(self.title.as_str(), (16, 12), ("sans-serif", 23)))?;
        let legend = self.legend();
        let below = draw_legend(&root, &legend)?;
        let (_, body) = root.split_vertically(below);
        for (panel, area) in self.panels.iter().zip(body.split_evenly((rows, columns))) {
            self.draw_panel(panel, &area, &legend)?;
        }
        root.present()?;
        Ok(())
    }

    /// The labels of all panels, each once.
    fn legend(&self) -> Vec<(String, Kind)> {
        let mut legend: Vec<(String, Kind)> = Vec::new();
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if !legend.iter().any(|(label, _)| *label == series.label) {
                legend.push((series.label.clone(), series.kind));
            }
        }
        legend
    }

    fn draw_panel(&self, panel: &Panel, area: &Area, legend: &[(String, Kind)]) -> Result {
        let scaled = |series: &Series| series.points.iter().map(|p| self.scaled(*p)).collect::<Vec<_>>();
        let curves: Vec<(&Series, Vec<(f64, f64)>)> = panel.series.iter().map(|s| (s, scaled(s))).collect();
        let several = panel.series.iter().filter(|series| series.kind == Kind::Curve).count() > 1;
        let range = |of: fn(&(f64, f64)) -> f64| {
            let values = curves.iter().flat_map(|(_, points)| points).map(of).filter(|v| v.is_finite());
            let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
            let pad = 0.05 * (high - low).max(1e-9);
            low - pad..high + pad
        };
        let mut builder = ChartBuilder::on(area);
        builder.margin(8).margin_right(16).x_label_area_size(46).y_label_area_size(78);
        if !panel.title.is_empty() {
            builder.caption(&panel.title, ("sans-serif", 18));
        }
        let mut chart = builder.build_cartesian_2d(range(|p| p.0), range(|p| p.1))?;
        let letters = ("sans-serif", LETTERS).into_font();
        let y_label = |y: &f64| if self.logarithmic { short(10f64.powf(*y), 2) } else { short(*y, 4) };
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(self.x).y_desc(self.y).x_labels(6).y_labels(6);
        mesh.x_label_formatter(&|x| short(*x, 4)).y_label_formatter(&y_label);
        mesh.label_style(letters.clone()).axis_desc_style(letters).light_line_style(WHITE).draw()?;
        for (series, points) in &curves {
            draw_series(&mut chart, series.kind, points, several, style(legend, &series.label))?;
        }
        Ok(())
    }

    /// A point as it is drawn.
    fn scaled(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (x, if self.logarithmic { y.abs().max(1e-4).log10() } else { y })
    }
}

type Chart<'a, 'b> = ChartContext<'b, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Draws the marker of a curve's number.
macro_rules! mark {
    ($area:expr, $number:expr, $at:expr, $style:expr) => {
        match $number % 5 {
            0 => $area.draw(&Circle::new($at, 4, $style.filled())),
            1 => $area.draw(&TriangleMarker::new($at, 6, $style.filled())),
            2 => $area.draw(&(EmptyElement::at($at) + Rectangle::new([(-4, -4), (4, 4)], $style))),
            3 => $area.draw(&Cross::new($at, 5, $style)),
            _ => $area.draw(&Circle::new($at, 5, $style)),
        }
    };
}

fn draw_series(
    chart: &mut Chart<'_, '_>,
    kind: Kind,
    points: &[(f64, f64)],
    several: bool,
    (number, style): (usize, ShapeStyle),
) -> Result {
    let finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
    for piece in points.split(|p| !finite(p)) {
        match kind {
            Kind::Curve => drop(chart.draw_series(LineSeries::new(piece.iter().copied(), style))?),
            Kind::Reference => drop(chart.draw_series(DashedLineSeries::new(piece.iter().copied(), 8, 5, style))?),
            Kind::Points => {}
        }
    }
    if kind == Kind::Reference || kind == Kind::Curve && !several {
        return Ok(());
    }
    // All points of a short curve; some of a long one, at different places for each curve.
    let every = if points.len() <= 40 { 1 } else { points.len().div_ceil(MARKERS) };
    let first = if every == 1 { 0 } else { every * (1 + number) / 7 };
    for point in points.iter().skip(first).step_by(every).filter(|p| finite(p)) {
        mark!(chart.plotting_area(), number, *point, style)?;
    }
    Ok(())
}

/// The labels in rows; gives back where they end.
fn draw_legend(root: &Area, legend: &[(String, Kind)]) -> core::result::Result<u32, Box<dyn std::error::Error>> {
    let (mut x, mut y) = (16, 46);
    let several = legend.iter().filter(|(_, kind)| *kind != Kind::Reference).count() > 1;
    for (label, kind) in legend {
        let (number, style) = style(legend, label);
        let width = 44 + label.chars().count() as i32 * 9 + 22;
        if x + width > WIDTH as i32 && x > 16 {
            (x, y) = (16, y + 24);
        }
        let lines = match kind {
            Kind::Reference => vec![(x, x + 13), (x + 20, x + 33)],
            Kind::Curve => vec![(x, x + 33)],
            Kind::Points => vec![],
        };
        for (from, to) in lines {
            root.draw(&PathElement::new([(from, y + 8), (to, y + 8)], style))?;
        }
        if *kind != Kind::Reference && several {
            mark!(root, number, (x + 16, y + 8), style)?;
        }
        root.draw(&Text::new(label.as_str(), (x + 42, y), ("sans-serif", LETTERS)))?;
        x += width;
    }
    Ok(y as u32 + 28)
}

/// Number and stroke of a label.
fn style(legend: &[(String, Kind)], label: &str) -> (usize, ShapeStyle) {
    let is_reference = |kind: &Kind| *kind == Kind::Reference;
    let mine = legend.iter().any(|(known, kind)| known == label && is_reference(kind));
    let alike = legend.iter().filter(|(_, kind)| is_reference(kind) == mine);
    let number = alike.into_iter().position(|(known, _)| known == label).unwrap_or(0);
    let color = if mine { REFERENCES[number % 2] } else { COLORS[number % COLORS.len()] };
    (number, color.stroke_width(2))
}
