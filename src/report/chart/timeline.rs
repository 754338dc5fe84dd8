//! [`Timeline`]: the whole record as it is drawn before anyone zooms, and on paper.

use super::curves::{Along, is_band, path, surface};
use super::scale::Scale;
use super::{Frame, Short, Size, class};
use crate::numeral::{exact, unit_after};
use crate::report::markup::Markup;
use crate::section::{Axis, Line, Panel, PanelKind, Stretch, Style, Timeline, Trace};
use core::fmt::{Display, Write};

/// Columns across the drawing of the whole record.
pub(in crate::report) const COLUMNS: usize = 500;

/// Height of a panel without its margins (px).
fn height(kind: PanelKind) -> f64 {
    match kind {
        PanelKind::Response => 220.0,
        PanelKind::Residual => 110.0,
        PanelKind::State => 160.0,
        PanelKind::Input => 80.0,
    }
}

/// The text below a panel: numbers below each output, the title below the last.
fn along(timeline: &Timeline, panel: &Panel) -> Along {
    match timeline.panels.last() == Some(panel) {
        true => Along::Titled,
        false if matches!(panel.kind, PanelKind::Response | PanelKind::State) => Along::Numbered,
        false => Along::Bare,
    }
}

/// Draws the panels below each other under a name for those who cannot see them.
pub(super) fn draw(timeline: &Timeline, to: &mut Markup, size: Size, name: &str) {
    match size {
        Size::Fluid(_) => panels(timeline, to, size, name),
        Size::Fixed(width) => {
            let whole = |panel: &Panel| height(panel.kind) + 24.0 + along(timeline, panel).room();
            let heights: Vec<f64> = timeline.panels.iter().map(whole).collect();
            let (whole, mut top) = (heights.iter().sum::<f64>(), 0.0);
            let view = format!("0 0 {width} {whole}");
            let attributes: [(&str, &dyn Display); 6] = [
                ("xmlns", &"http://www.w3.org/2000/svg"),
                ("width", &width),
                ("height", &whole),
                ("viewBox", &view),
                ("role", &"img"),
                ("aria-label", &name),
            ];
            to.node("svg", &attributes, |svg| {
                svg.words("title", &[], name);
                let mut first = 0;
                for (drawn, height) in timeline.panels.iter().zip(&heights) {
                    svg.node("svg", &[("y", &top)], |svg| panel(timeline, drawn, first, svg, size, name));
                    first += drawn.lines.len();
                    top += height;
                }
            });
        }
    }
}

fn panels(timeline: &Timeline, to: &mut Markup, size: Size, name: &str) {
    let mut first = 0;
    for (i, drawn) in timeline.panels.iter().enumerate() {
        let of = match drawn.kind {
            PanelKind::Response | PanelKind::State => format!("{name}: {}", drawn.name),
            PanelKind::Residual | PanelKind::Input => format!("{name}: {} of it", drawn.name),
        };
        let attributes: [(&str, &dyn Display); 2] = [("class", &"panel"), ("data-panel", &i)];
        to.node("div", &attributes, |to| panel(timeline, drawn, first, to, size, &of));
        first += drawn.lines.len();
    }
}

/// One panel, whose first trace has this number.
fn panel(timeline: &Timeline, panel: &Panel, first: usize, to: &mut Markup, size: Size, name: &str) {
    let Some(whole) = timeline.stretches.first() else { return };
    let x = Scale::new(&time_axis(timeline), whole.t.first().copied().zip(whole.t.last().copied()));
    let traces = || panel.lines.iter().zip(whole.traces.get(first..).unwrap_or_default());
    let center = traces().find(|(line, _)| line.style == Style::Predicted).map(|(_, trace)| trace);
    let drawn = traces().filter(|(line, _)| !is_band(line.style)).flat_map(|(_, trace)| trace.extremes().flatten());
    // A state may move by less than is known of it.
    let banded = traces().filter(|(line, _)| panel.kind == PanelKind::State && is_band(line.style));
    let banded =
        banded.flat_map(|(_, half)| center.into_iter().flat_map(|center| center.means().iter().zip(&half.low)));
    let banded = banded.filter_map(|(mean, half)| mean.zip(*half)).map(|(mean, half)| (mean - half, mean + half));
    let range = drawn.chain(banded).fold(None, |range: Option<(f64, f64)>, (low, high)| {
        Some(range.map_or((low, high), |(least, greatest)| (least.min(low), greatest.max(high))))
    });
    let y = Scale::new(&Axis::new(&panel.name, &panel.unit), range).with_room();
    let height = height(panel.kind);
    let columns = if let Size::Fluid(columns) = size { columns } else { COLUMNS };
    let stretched = |frame: &Frame, svg: &mut Markup| {
        let surface = Surface { frame, x: &x, y: &y, whole, columns };
        for (line, trace) in traces() {
            let d = match (is_band(line.style), center) {
                (true, Some(center)) => surface.band(center, trace),
                (true, None) => continue,
                (false, _) => surface.line(line, trace),
            };
            let shape = if is_band(line.style) { "area" } else { "line" };
            let attributes: [(&str, &dyn Display); 2] =
                [("class", &format_args!("{shape} {}", class(line.style))), ("d", &d)];
            svg.leaf("path", &attributes);
        }
    };
    surface(to, size, name, (height, along(timeline, panel)), (&x, &y), stretched, |_, _| {});
}

/// Time since the start of the record, which is named where it is not zero.
pub(in crate::report) fn time_axis(timeline: &Timeline) -> Axis {
    match timeline.start {
        0.0 => Axis::new("time", &timeline.time_unit),
        start => {
            let name = format!("time since t = {}{}", exact(start), unit_after(&timeline.time_unit));
            Axis::new(name, &timeline.time_unit)
        }
    }
}

/// Entries of the legend: each style once, with its name.
pub(in crate::report) fn keys(timeline: &Timeline) -> Vec<(&'static str, &str)> {
    let mut keys: Vec<(&str, &str)> = vec![];
    for (panel, line) in timeline.lines().filter(|(panel, _)| panel.kind != PanelKind::Input) {
        let name = if panel.kind == PanelKind::Residual { "residual" } else { line.name.as_str() };
        if !keys.iter().any(|(_, other)| *other == name) {
            keys.push((class(line.style), name));
        }
    }
    keys
}

/// Values that share a column of the drawing: the times of the first and last, and what is made of them.
#[derive(Clone, Copy)]
struct Column<T> {
    begin: f64,
    end: f64,
    value: T,
}

/// The least and greatest of several values, and those of the first and the last of them.
#[derive(Clone, Copy)]
struct Span {
    ends: (f64, f64),
    first: (f64, f64),
    last: (f64, f64),
}

/// Where the values of a stretch are drawn.
struct Surface<'a> {
    frame: &'a Frame,
    x: &'a Scale,
    y: &'a Scale,
    whole: &'a Stretch,
    /// Columns that the whole is drawn in at most.
    columns: usize,
}

impl Surface<'_> {
    fn place(&self, t: f64, value: f64) -> (f64, f64) {
        (self.frame.width() * self.x.at(t), self.frame.height * (1.0 - self.y.at(value)))
    }

    /// The columns of the drawing, each with what `merge` makes of the values in it; `None` between those that are apart.
    /// Where there are few enough, each value has a column of its own.
    fn columns<T: Copy>(
        &self,
        values: impl Iterator<Item = Option<T>>,
        merge: impl Fn(T, T) -> T,
    ) -> Vec<Option<Column<T>>> {
        let few = self.whole.t.len() <= self.columns;
        let width = if few { 0.0 } else { (self.x.to - self.x.from) / self.columns.max(1) as f64 };
        let mut columns: Vec<Option<Column<T>>> = vec![];
        // The last column's begin, the last value's time, and whether values are missing since.
        let (mut begin, mut last, mut missing) = (f64::NEG_INFINITY, f64::NEG_INFINITY, false);
        for (&t, value) in self.whole.t.iter().zip(values) {
            let Some(value) = value else {
                missing = true;
                continue;
            };
            let apart = missing && t - last > width;
            match columns.last_mut() {
                Some(Some(column)) if !apart && t - begin < width => {
                    (column.end, column.value) = (t, merge(column.value, value));
                }
                _ => {
                    if apart && !columns.is_empty() {
                        columns.push(None);
                    }
                    columns.push(Some(Column { begin: t, end: t, value }));
                    begin = t;
                }
            }
            (last, missing) = (t, false);
        }
        columns
    }

    /// A line through all columns: along one in which the values rise or fall all the way, else up and down.
    fn line(&self, line: &Line, trace: &Trace) -> String {
        let spans = trace.extremes().map(|ends| ends.map(|ends| Span { ends, first: ends, last: ends }));
        let wider = |a: Span, b: Span| {
            let ends = (a.ends.0.min(b.ends.0), a.ends.1.max(b.ends.1));
            Span { ends, first: a.first, last: b.last }
        };
        let mut before: Option<f64> = None;
        let mut places = vec![];
        for column in self.columns(spans, wider) {
            let Some(Column { begin, end, value }) = column else {
                before = None;
                places.push(None);
                continue;
            };
            let (low, high) = value.ends;
            if let Some(held) = before.filter(|_| line.held && low == high) {
                places.push(Some(self.place(begin, held)));
            }
            // Up and down, from the end that is nearer to where the line stands.
            let nearer = before.is_none_or(|before| (before - low).abs() <= (before - high).abs());
            let (rises, falls) =
                (value.first.0 == low && value.last.1 == high, value.first.1 == high && value.last.0 == low);
            let upwards = if rises == falls { nearer } else { rises };
            let end = if rises == falls { begin } else { end };
            let (first, last) = if upwards { (low, high) } else { (high, low) };
            places.push(Some(self.place(begin, first)));
            if last != first {
                places.push(Some(self.place(end, last)));
            }
            before = Some(last);
        }
        path(places.into_iter())
    }

    /// The surface so far above and below the means of a line; in each column the mean of both.
    fn band(&self, center: &Trace, half: &Trace) -> String {
        let pairs = center.means().iter().zip(&half.low);
        let values = pairs.map(|(mean, half)| Some(((*mean)?, (*half)?, 1.0)));
        let sum = |a: (f64, f64, f64), b: (f64, f64, f64)| (a.0 + b.0, a.1 + b.1, a.2 + b.2);
        let columns = self.columns(values, sum);
        let mut d = String::new();
        for piece in columns.split(Option::is_none).filter(|piece| !piece.is_empty()) {
            let edge = |sign: f64| {
                move |column: &Column<(f64, f64, f64)>| {
                    let (mean, half, count) = column.value;
                    (column.begin, (mean + sign * half) / count)
                }
            };
            let there = piece.iter().flatten().map(edge(1.0));
            let back = piece.iter().rev().flatten().map(edge(-1.0));
            for (i, (t, value)) in there.chain(back).enumerate() {
                let (x, y) = self.place(t, value);
                // Writing to a string does not fail.
                let _ = write!(d, "{}{} {}", if i == 0 { 'M' } else { 'L' }, Short(x), Short(y));
            }
            d.push('Z');
        }
        d
    }
}
