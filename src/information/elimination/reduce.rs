//! The elimination itself: from the leaves to the shared unknowns, and the solution back down.

use super::{Elimination, entry};
use crate::information::{Block, Information, norm};
use std::borrow::Cow;

/// Rows gathered for one absorption.
const ROWS: usize = 64;

/// Assumptions of the elimination on the unknowns, by their numbers; missing entries are zeros.
#[derive(Clone, Copy, Default)]
pub(super) struct Terms<'a> {
    /// Rows `diag(damping) d = 0` are added.
    pub damping: &'a [f64],
    /// Unknowns that stay where `origin` puts them.
    pub held: &'a [bool],
    /// The unknowns are counted from here.
    pub origin: &'a [f64],
}

/// A triangle of free unknowns of a piece and of its free border. Its first rows are those of the own unknowns; what
/// stands below them is what it says of the border.
pub(super) struct Reduced<'a> {
    /// Number of own unknowns.
    pub own: usize,
    /// The unknown behind each column.
    pub columns: Cow<'a, [usize]>,
    pub triangle: Cow<'a, Information>,
}

/// All pieces reduced.
pub(super) struct Reduction<'a> {
    /// The triangle of the shared unknowns, all others minimized out.
    pub total: Reduced<'a>,
    pub pieces: Vec<Reduced<'a>>,
}

/// Working space of an elimination.
pub(super) struct Space {
    block: Option<Block>,
    row: Vec<f64>,
    /// Column of each unknown in the triangle that is being made.
    place: Vec<usize>,
}

impl Space {
    pub fn new(unknowns: usize) -> Self {
        Space { block: None, row: vec![], place: vec![usize::MAX; unknowns] }
    }
}

impl Elimination {
    pub(super) fn reduce(&self, terms: Terms<'_>) -> Reduction<'_> {
        let mut space = Space::new(self.unknowns());
        // Children have higher numbers than their parents; piece `k` stands at `pieces.len() - 1 - k` until the end.
        let mut done = Vec::with_capacity(self.pieces.len());
        for number in (0..self.pieces.len()).rev() {
            done.push(self.reduce_piece(number, &done, terms, &mut space));
        }
        let total = self.reduce_shared(&done, terms, &mut space);
        done.reverse();
        Reduction { total, pieces: done }
    }

    /// One piece, given all with higher numbers, the last first.
    pub(super) fn reduce_piece<'a>(
        &'a self,
        number: usize,
        done: &[Reduced<'a>],
        terms: Terms<'_>,
        space: &mut Space,
    ) -> Reduced<'a> {
        let piece = &self.pieces[number];
        let (own, border) = piece.columns.split_at(piece.own);
        let untouched = piece.columns.iter().all(|&i| !terms.holds(i) && entry(terms.origin, i) == 0.0)
            && own.iter().all(|&i| entry(terms.damping, i) == 0.0);
        if untouched && piece.children.is_empty() {
            let (columns, triangle) = (Cow::Borrowed(piece.columns.as_slice()), Cow::Borrowed(&piece.triangle));
            return Reduced { own: piece.own, columns, triangle };
        }
        let free_own = own.iter().copied().filter(|&i| !terms.holds(i));
        let mut columns: Vec<usize> = free_own.collect();
        let own = columns.len();
        columns.extend(border.iter().copied().filter(|&i| !terms.holds(i)));
        let passed_up: usize = piece.children.iter().map(|&child| self.child(child, done).passed_up()).sum();
        let rows = piece.columns.len() + 1 + own + passed_up;
        let mut gather = Gather::new(&piece.columns, &columns, rows, space);
        gather.own_rows(&piece.triangle, &piece.columns, terms.origin);
        piece.children.iter().for_each(|&child| gather.passed_up(self.child(child, done)));
        let mut gather = gather.cleaned(&columns, piece.children.len() + 1, &columns[..own], terms.damping);
        gather.damping(&columns[..own], terms.damping);
        Reduced { own, triangle: Cow::Owned(gather.triangle()), columns: Cow::Owned(columns) }
    }

    /// A reduced piece, given all with higher numbers, the last first.
    fn child<'d, 'a>(&self, number: usize, done: &'d [Reduced<'a>]) -> &'d Reduced<'a> {
        &done[self.pieces.len() - 1 - number]
    }

    /// The shared unknowns, given all pieces, the last first.
    pub(super) fn reduce_shared<'a>(&self, done: &[Reduced<'a>], terms: Terms<'_>, space: &mut Space) -> Reduced<'a> {
        let shared: Vec<usize> = (0..self.shared).collect();
        let columns: Vec<usize> = shared.iter().copied().filter(|&i| !terms.holds(i)).collect();
        let passed_up: usize = self.children(None).iter().map(|&child| self.child(child, done).passed_up()).sum();
        let mut gather = Gather::new(&shared, &columns, columns.len() + passed_up, space);
        let children = self.children(None);
        children.iter().for_each(|&child| gather.passed_up(self.child(child, done)));
        let mut gather = gather.cleaned(&columns, children.len(), &columns, terms.damping);
        gather.damping(&columns, terms.damping);
        Reduced { own: columns.len(), triangle: Cow::Owned(gather.triangle()), columns: Cow::Owned(columns) }
    }

    /// The step that minimizes the linearized sum of squares plus `|diag(damping) step|^2`, with the unknowns in `held`
    /// kept; `None` where the free unknowns are not determined. Missing entries of both stand for zero and not held.
    pub fn step(&self, damping: &[f64], held: &[bool]) -> Option<Vec<f64>> {
        self.solve(Terms { damping, held, origin: &[] })
    }

    /// The minimizer, counted from the origin.
    pub(super) fn solve(&self, terms: Terms<'_>) -> Option<Vec<f64>> {
        if let Some(alone) = self.single_piece(terms) {
            let mut step = vec![0.0; self.unknowns()];
            alone.is_determined(&self.norms, terms.damping).then(|| alone.substitute(&mut step))?;
            return step.iter().all(|d| d.is_finite()).then_some(step);
        }
        let Reduction { total, pieces } = self.reduce(terms);
        let mut step = vec![0.0; self.unknowns()];
        for piece in std::iter::once(&total).chain(&pieces) {
            piece.is_determined(&self.norms, terms.damping).then(|| piece.substitute(&mut step))?;
        }
        step.iter().all(|d| d.is_finite()).then_some(step)
    }

    /// The damped triangle of all unknowns; `None` where there is more than one piece, an unknown is held, or a pivot is rounding.
    fn single_piece(&self, terms: Terms<'_>) -> Option<Reduced<'_>> {
        let [piece] = self.pieces.as_slice() else { return None };
        let (triangle, n) = (&piece.triangle, piece.columns.len());
        let free = |&i: &usize| !terms.holds(i) && entry(terms.origin, i) == 0.0;
        let sound = |i: usize| triangle.at(i, i) > triangle.tolerance() * self.norms[piece.columns[i]];
        if n < self.unknowns() || !piece.columns.iter().all(free) || !(0..n).all(sound) {
            return None;
        }
        let mut damped = triangle.clone();
        let mut row = vec![0.0; n + 1];
        for (i, &unknown) in piece.columns.iter().enumerate() {
            let damping = entry(terms.damping, unknown);
            if damping != 0.0 {
                row[i..].fill(0.0);
                row[i] = damping;
                damped.rotate(&mut row[i..], i);
            }
        }
        Some(Reduced { own: n, columns: Cow::Borrowed(&piece.columns), triangle: Cow::Owned(damped) })
    }
}

impl Terms<'_> {
    pub fn holds(&self, unknown: usize) -> bool {
        self.held.get(unknown).copied().unwrap_or(false)
    }
}

impl Reduced<'_> {
    /// How many rows it passes to its parent.
    fn passed_up(&self) -> usize {
        self.columns.len() + 1 - self.own
    }

    /// Whether each own unknown has more of its column for itself than rounding.
    fn is_determined(&self, norms: &[f64], damping: &[f64]) -> bool {
        let usable = |(i, &unknown): (usize, &usize)| {
            let norm = norm([norms[unknown], entry(damping, unknown)].into_iter());
            // Also false for NaN.
            norm.is_finite() && self.triangle.at(i, i) / norm > self.triangle.tolerance()
        };
        self.columns[..self.own].iter().enumerate().all(usable)
    }

    /// Puts the own unknowns into a step whose border is known.
    fn substitute(&self, step: &mut [f64]) {
        for i in (0..self.own).rev() {
            let (y, row) = self.triangle.row(i);
            let known: f64 = row.iter().zip(&self.columns[i..]).skip(1).map(|(r, &unknown)| r * step[unknown]).sum();
            step[self.columns[i]] = (y - known) / row[0];
        }
    }
}

/// Rows for the triangle of some unknowns.
pub(super) struct Gather<'s> {
    information: Information,
    rows: u64,
    space: &'s mut Space,
}

impl<'s> Gather<'s> {
    /// For a triangle of `columns`, out of rows whose unknowns are among `all`; `rows` are expected.
    pub fn new(all: &[usize], columns: &[usize], rows: usize, space: &'s mut Space) -> Self {
        let capacity = rows.clamp(1, ROWS);
        if space.block.as_ref().is_none_or(|block| block.columns() != columns.len() || block.capacity() < capacity) {
            space.block = Some(Block::new(columns.len(), capacity));
        }
        space.row.clear();
        space.row.resize(columns.len(), 0.0);
        all.iter().for_each(|&unknown| space.place[unknown] = usize::MAX);
        columns.iter().enumerate().for_each(|(c, &unknown)| space.place[unknown] = c);
        Gather { information: Information::new(columns.len()), rows: 0, space }
    }

    /// All rows of a triangle with these unknowns behind its columns, counted from the origin. Unknowns that have no
    /// column here are left out.
    pub fn own_rows(&mut self, triangle: &Information, columns: &[usize], origin: &[f64]) {
        for i in 0..=triangle.columns() {
            self.take(triangle, i, columns, origin);
        }
        self.rows += triangle.rows();
    }

    /// The rows that a reduced piece passes to its parent.
    fn passed_up(&mut self, child: &Reduced<'_>) {
        for i in child.own..=child.columns.len() {
            self.take(&child.triangle, i, &child.columns, &[]);
        }
        self.rows += child.triangle.rows();
    }

    /// Row `i` of a triangle. Where its pivot is no more than rounding of its column, so are entries that are as small:
    /// kept, they would move damped steps along directions of which nothing is known.
    fn take(&mut self, triangle: &Information, i: usize, columns: &[usize], origin: &[f64]) {
        let (y, row) = triangle.row(i);
        let columns = columns.get(i..).unwrap_or_default();
        let moved: f64 = row.iter().zip(columns).map(|(r, &unknown)| r * entry(origin, unknown)).sum();
        let rounding = |r: f64, column: usize| r.abs() <= triangle.tolerance() * triangle.column_norm(column);
        if row.first().is_some_and(|&pivot| pivot != 0.0 && rounding(pivot, i)) {
            let cleaned = row.iter().enumerate().map(|(j, &r)| if rounding(r, i + j) { 0.0 } else { r });
            self.push(&cleaned.collect::<Vec<f64>>(), columns, y - moved);
        } else {
            self.push(row, columns, y - moved);
        }
    }

    /// The same rows, those of several triangles as one: rounding that they leave together is cleaned before damping is
    /// added, which may be far smaller than it.
    fn cleaned(self, columns: &[usize], triangles: usize, own: &[usize], damping: &[f64]) -> Gather<'s> {
        if triangles < 2 || own.iter().all(|&unknown| entry(damping, unknown) == 0.0) {
            return self;
        }
        let (merged, space) = self.finished();
        let mut gather = Gather::new(columns, columns, columns.len() + 1 + own.len(), space);
        gather.own_rows(&merged, columns, &[]);
        gather
    }

    fn damping(&mut self, own: &[usize], damping: &[f64]) {
        for unknown in own {
            let value = entry(damping, *unknown);
            if value != 0.0 {
                self.push(&[value], std::slice::from_ref(unknown), 0.0);
            }
        }
    }

    pub fn push(&mut self, slopes: &[f64], unknowns: &[usize], y: f64) {
        let Space { block, row, place } = &mut *self.space;
        row.fill(0.0);
        for (slope, &unknown) in slopes.iter().zip(unknowns) {
            if let Some(entry) = row.get_mut(place[unknown]) {
                *entry = *slope;
            }
        }
        if let Some(block) = block {
            self.information.gather(block, row, y);
        }
    }

    pub fn triangle(self) -> Information {
        self.finished().0
    }

    fn finished(mut self) -> (Information, &'s mut Space) {
        if let Some(block) = &mut self.space.block {
            self.information.absorb(block);
        }
        self.information.rows = self.rows;
        (self.information, self.space)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The second of two columns that are the same but for rounding: what is left of its row beside a pivot that is rounding is
    /// taken as zero where it is as small; the same numbers beside a pivot that is none, or is zero, stay.
    #[test]
    fn rows_of_rounding_are_cleaned() {
        let passed = |pivot: f64| {
            let mut triangle = Information::new(3);
            triangle.triangle = vec![1.0, 1.0, 1.0, 2.0, pivot, 1e-18, 3.0, 0.5, 4.0, 0.0];
            let mut space = Space::new(3);
            let mut gather = Gather::new(&[0, 1, 2], &[0, 1, 2], 1, &mut space);
            gather.take(&triangle, 1, &[0, 1, 2], &[]);
            let row = gather.triangle();
            // One row of slopes: its square over the first column that is not zero.
            let first = (0..3).find(|&c| row.at(c, c) != 0.0);
            (first, (0..=3).map(|c| first.map_or(0.0, |i| row.at(i, c))).collect::<Vec<f64>>())
        };
        assert_eq!(passed(1e-17), (None, vec![0.0; 4]));
        assert_eq!(passed(0.5), (Some(1), vec![0.0, 0.5, 1e-18, 3.0]));
        assert_eq!(passed(0.0), (Some(2), vec![0.0, 0.0, 1e-18, 3.0]));
    }
}
