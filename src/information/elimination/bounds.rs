//! Steps between bounds.

use super::reduce::Terms;
use super::{Elimination, entry};

impl Elimination {
    /// As [`step`](Self::step), within this room (at most zero, at least zero) for each unknown. An unknown that would leave
    /// it is put on its end, first come, first put, and the others are minimized again: every stage lowers the damped sum
    /// of squares further. Pieces that do not depend on one another but through those above them have one unknown each
    /// put in the same stage, so that the number of stages does not grow with the number of pieces; should that end
    /// higher than where the first stage came to, the step ends there.
    pub fn step_within(&self, damping: &[f64], held: &[bool], room: &[(f64, f64)]) -> Option<Vec<f64>> {
        let free_step = self.step(damping, held)?;
        let mut stage = Stage {
            held: (0..self.unknowns()).map(|i| held.get(i).copied().unwrap_or(false)).collect(),
            at: vec![0.0; self.unknowns()],
            put: vec![0.0; self.unknowns()],
            step: free_step,
        };
        let depths = self.depths();
        // Where the first stage came to, if any stage put several.
        let (mut fallback, mut several) = (None, false);
        loop {
            let first = self.first_beyond(&stage, room, &depths);
            let Some(&(part, _)) = first.first() else { break };
            stage.advance(part, &first, room);
            several |= first.len() > 1;
            fallback.get_or_insert_with(|| stage.at.clone());
            stage.step = self.solve(Terms { damping, held: &stage.held, origin: &stage.put })?;
            stage.step.iter_mut().zip(&stage.put).for_each(|(step, put)| *step += put);
        }
        let gain = |step: &[f64]| {
            let damped: f64 = step.iter().enumerate().map(|(i, d)| (entry(damping, i) * d).powi(2)).sum();
            self.predicted_reduction(step) - 0.5 * damped
        };
        match fallback.filter(|fallback| several && gain(fallback) > gain(&stage.step)) {
            Some(fallback) => Some(fallback),
            None => Some(stage.step),
        }
    }

    /// Distance of each piece from the shared unknowns.
    fn depths(&self) -> Vec<usize> {
        let mut depths: Vec<usize> = Vec::with_capacity(self.pieces.len());
        for piece in &self.pieces {
            depths.push(piece.parent.map_or(1, |parent| depths[parent] + 1));
        }
        depths
    }

    /// The first unknown to leave its room on the way from `at` to `step`, at what part of the way; after it the first of
    /// each other piece of the same depth.
    fn first_beyond(&self, stage: &Stage, room: &[(f64, f64)], depths: &[usize]) -> Vec<(f64, usize)> {
        let among = |own: &mut dyn Iterator<Item = usize>| {
            let beyond = own.filter(|&i| stage.beyond(i, room).is_some());
            beyond.map(|i| (stage.part(i, room), i)).min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let mut first = vec![];
        first.extend(among(&mut (0..self.shared)).map(|found| (0, found)));
        for (piece, &depth) in self.pieces.iter().zip(depths) {
            first.extend(among(&mut piece.columns[..piece.own].iter().copied()).map(|found| (depth, found)));
        }
        let Some(&(depth, earliest)) = first.iter().min_by(|a, b| a.1.0.total_cmp(&b.1.0)) else { return vec![] };
        let others = first.into_iter().filter(|&(other, (_, i))| other == depth && i != earliest.1);
        std::iter::once(earliest).chain(others.map(|(_, found)| found)).collect()
    }
}

/// How far the search for a step within bounds has come.
struct Stage {
    held: Vec<bool>,
    /// The point reached, and the minimizer that is to be reached from it.
    at: Vec<f64>,
    step: Vec<f64>,
    /// Where unknowns were put on an end.
    put: Vec<f64>,
}

impl Stage {
    /// The end of its room that a free unknown would go beyond.
    fn beyond(&self, i: usize, room: &[(f64, f64)]) -> Option<f64> {
        let &(down, up) = room.get(i).filter(|_| !self.held[i])?;
        match self.step[i] {
            step if step < down => Some(down),
            step if step > up => Some(up),
            _ => None,
        }
    }

    /// The part of the way at which it gets there.
    fn part(&self, i: usize, room: &[(f64, f64)]) -> f64 {
        let end = self.beyond(i, room).unwrap_or(self.step[i]);
        ((end - self.at[i]) / (self.step[i] - self.at[i])).clamp(0.0, 1.0)
    }

    /// Goes this part of the way, and puts unknowns on their ends.
    fn advance(&mut self, part: f64, first: &[(f64, usize)], room: &[(f64, f64)]) {
        self.at.iter_mut().zip(&self.step).for_each(|(at, step)| *at += part * (step - *at));
        for &(_, i) in first {
            if let Some(end) = self.beyond(i, room) {
                (self.put[i], self.held[i]) = (end, true);
            }
        }
        // The others have not come as far yet.
        if let Some(&(_, i)) = first.first() {
            self.at[i] = self.put[i];
        }
    }
}
