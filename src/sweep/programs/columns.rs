//! [`Columns`]: what a program reads, gathered from the records of its lanes.

use super::derived::{derived, step};
use super::late::Late;
use crate::engine::{Column, Program};
use crate::record::Record;
use crate::sweep::Piece;
use crate::wide::{self, Task, Wide, Width};
use std::sync::Arc;

/// Numbers of several pieces' records, sample by sample, column by column, lane by lane.
pub(super) struct Columns<'r> {
    records: Vec<&'r Record>,
    /// The derived columns of each lane's record, where they are kept.
    derived: Vec<Option<Arc<Vec<Vec<f64>>>>>,
    lanes: usize,
    width: Width,
    /// By column, then by lane.
    inputs: Vec<Vec<ColumnSource<'r>>>,
    /// By output, then by lane.
    outputs: Vec<Vec<&'r [f64]>>,
    next: usize,
}

/// Where the numbers of a column come from.
enum ColumnSource<'r> {
    Values(&'r [f64]),
    Time,
    Step,
    /// Number of the derived column.
    Derived(usize),
    /// Values, and how many samples before; not a number where that is none.
    Late(&'r [f64], Option<isize>),
}

impl<'r> Columns<'r> {
    /// Of pieces in so many lanes; those without a piece repeat the first.
    pub fn new(program: &Program, late: Option<&Late>, pieces: &[Piece<'r>], lanes: usize) -> Self {
        let piece = |lane: usize| pieces.get(lane).unwrap_or(&pieces[0]);
        let of = |piece: &Piece<'r>| (piece.record, piece.prepared.derived.of(program, piece.record));
        let (records, derived): (Vec<&'r Record>, Vec<_>) = (0..lanes).map(piece).map(of).unzip();
        let whole = |lane: usize| late.map_or(vec![], |late| late.whole(piece(lane)));
        let whole: Vec<_> = (0..lanes).map(whole).collect();
        let source = |lane: usize, record: &'r Record, column: &Column| match *column {
            Column::Time => ColumnSource::Time,
            Column::Step => ColumnSource::Step,
            Column::Input(i) => ColumnSource::Values(&record.inputs()[i].values),
            Column::Measured(j) => ColumnSource::Values(&record.outputs()[j].values),
            Column::Derived(n) => ColumnSource::Derived(n),
            Column::Late(i, after) => {
                let behind = late.and_then(|late| late.behind(&whole[lane], i, after));
                ColumnSource::Late(&record.inputs()[i].values, behind)
            }
        };
        let sources = |column| records.iter().enumerate().map(|(lane, r)| source(lane, r, column)).collect();
        let inputs = program.columns().iter().map(sources);
        let outputs = (0..program.outputs()).map(|j| records.iter().map(|r| &r.outputs()[j].values[..]).collect());
        let (inputs, outputs) = (inputs.collect(), outputs.collect());
        let next = usize::from(program.reads_next());
        Columns { lanes: records.len(), width: program.width(), inputs, outputs, records, derived, next }
    }

    /// Rows of inputs that so many samples need.
    pub fn rows(&self, samples: usize) -> usize {
        samples + self.next
    }

    /// Reads the inputs of some samples of each lane, from its own first one on; beyond a record's last sample, that is
    /// repeated.
    pub fn read(&self, program: &Program, begin: &[usize], samples: usize, to: &mut [f64]) {
        let (rows, stride) = (self.rows(samples), self.inputs.len() * self.lanes);
        let derives = self.inputs.iter().any(|sources| matches!(sources[..], [ColumnSource::Derived(_), ..]));
        let here = |lane: usize| match &self.derived[lane] {
            None if derives => derived(program, self.records[lane], begin[lane], rows),
            _ => vec![],
        };
        let here: Vec<_> = if derives { (0..self.lanes).map(here).collect() } else { vec![] };
        for (c, sources) in self.inputs.iter().enumerate() {
            let to = &mut to[c * self.lanes..];
            match sources.first() {
                Some(ColumnSource::Values(_)) => {
                    let values = |lane: usize| match sources[lane] {
                        ColumnSource::Values(values) => values,
                        _ => &[],
                    };
                    self.transpose(values, Some(begin), rows, stride, to);
                }
                Some(ColumnSource::Derived(n)) => {
                    let values = |lane: usize| match &self.derived[lane] {
                        Some(kept) => kept[*n].get(begin[lane]..).unwrap_or_default(),
                        None => &here[lane][*n],
                    };
                    self.transpose(values, None, rows, stride, to);
                }
                Some(ColumnSource::Time) => {
                    self.each(begin, rows, stride, to, |record, sample| record.time(sample.min(record.len() - 1)))
                }
                Some(ColumnSource::Step) => self.each(begin, rows, stride, to, step),
                Some(ColumnSource::Late(..)) => self.late(sources, begin, rows, stride, to),
                None => {}
            }
        }
    }

    /// Reads a late input, before the record that of its first sample.
    fn late(&self, sources: &[ColumnSource<'r>], begin: &[usize], rows: usize, stride: usize, to: &mut [f64]) {
        let source = |lane: usize| match sources[lane] {
            ColumnSource::Late(values, behind) => (values, behind),
            _ => (&[][..], None),
        };
        let from = |(lane, begin): (usize, &usize)| begin.checked_add_signed(-source(lane).1?);
        if let Some(from) = begin.iter().enumerate().map(from).collect::<Option<Vec<usize>>>() {
            return self.transpose(|lane| source(lane).0, Some(&from), rows, stride, to);
        }
        for (lane, begin) in begin.iter().enumerate() {
            let (values, behind) = source(lane);
            for k in 0..rows {
                let sample = behind.map(|behind| (begin + k).saturating_add_signed(-behind).min(values.len() - 1));
                to[k * stride + lane] = sample.map_or(f64::NAN, |sample| values[sample]);
            }
        }
    }

    /// Reads what was measured at some samples of each lane.
    pub fn read_measured(&self, begin: &[usize], samples: usize, to: &mut [f64]) {
        let stride = self.outputs.len() * self.lanes;
        for (j, lanes) in self.outputs.iter().enumerate() {
            self.transpose(|lane| lanes[lane], Some(begin), samples, stride, &mut to[j * self.lanes..]);
        }
    }

    fn each(
        &self,
        begin: &[usize],
        rows: usize,
        stride: usize,
        to: &mut [f64],
        number: impl Fn(&Record, usize) -> f64,
    ) {
        for (k, row) in to.chunks_mut(stride).take(rows).enumerate() {
            for ((to, record), begin) in row.iter_mut().zip(&self.records).zip(begin) {
                *to = number(record, begin + k);
            }
        }
    }

    /// Columns of values, one for each lane, from where each begins on, or as they are.
    fn transpose<'v>(
        &self,
        values: impl Fn(usize) -> &'v [f64],
        begin: Option<&[usize]>,
        rows: usize,
        stride: usize,
        to: &mut [f64],
    ) {
        let register = self.width.lanes();
        let mut lane = 0;
        while lane < self.lanes {
            let whole = (2..=self.lanes - lane).contains(&register);
            let from: [&[f64]; LANES] = std::array::from_fn(|l| {
                let lane = if whole { lane + l % register } else { lane };
                let values = values(lane);
                &values[begin.map_or(0, |begin| begin[lane]).min(values.len())..]
            });
            if whole && from.iter().all(|values| values.len() >= rows) {
                let from = from.map(|values| &values[..rows]);
                wide::run(self.width, Transpose { from, stride, to: &mut to[lane..] });
                lane += register;
                continue;
            }
            let last = values(lane).last().copied().unwrap_or(0.0);
            for k in 0..rows {
                to[k * stride + lane] = from[0].get(k).copied().unwrap_or(last);
            }
            lane += 1;
        }
    }
}

/// Lanes of the widest register.
const LANES: usize = 8;

/// Turns as many columns of the same length as a register has lanes into rows.
struct Transpose<'t> {
    /// Lanes beyond the first register are not read.
    from: [&'t [f64]; LANES],
    stride: usize,
    to: &'t mut [f64],
}

impl Task for Transpose<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        let Transpose { from, stride, to } = self;
        let rows = from[0].len();
        let whole = rows - rows % W::LANES;
        let mut k = 0;
        while k < whole {
            let mut square = [W::splat(0.0); LANES];
            let mut lane = 0;
            while lane < W::LANES {
                square[lane] = W::load(&from[lane][k..]);
                lane += 1;
            }
            let square = W::transpose(square);
            let mut row = 0;
            while row < W::LANES {
                square[row].store(&mut to[(k + row) * stride..]);
                row += 1;
            }
            k += W::LANES;
        }
        while k < rows {
            let to = &mut to[k * stride..][..W::LANES];
            let mut lane = 0;
            while lane < W::LANES {
                to[lane] = from[lane][k];
                lane += 1;
            }
            k += 1;
        }
    }
}
