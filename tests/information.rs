//! The information triangle against faer's QR, against itself, and against closed forms.
use greybox::{Block, Information};

/// Numbers in -1..1, the same on every run.
struct Noise(u64);
impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

type Row = (Vec<f64>, f64);

fn random_rows(columns: usize, rows: usize, seed: u64) -> Vec<Row> {
    let mut noise = Noise(seed);
    (0..rows).map(|_| ((0..columns).map(|_| noise.next()).collect(), noise.next())).collect()
}

fn absorbed(columns: usize, rows: &[Row], capacity: usize) -> Information {
    let mut information = Information::new(columns);
    let mut block = Block::new(columns, capacity);
    for (phi, y) in rows {
        if block.is_full() {
            information.absorb(&mut block);
        }
        assert!(block.push(phi, *y));
    }
    information.absorb(&mut block);
    assert_eq!(information.rows(), rows.len() as u64);
    information
}

fn entries(information: &Information) -> Vec<f64> {
    let width = information.columns() + 1;
    (0..width).flat_map(|i| (i..width).map(move |j| information.at(i, j))).collect()
}

#[track_caller]
fn assert_close(a: &Information, b: &Information, tolerance: f64) {
    assert_eq!((a.columns(), a.rows()), (b.columns(), b.rows()));
    let largest = entries(a).iter().fold(0.0, |m: f64, e| m.max(e.abs()));
    for (a, b) in entries(a).iter().zip(entries(b)) {
        assert!((a - b).abs() <= tolerance * largest, "{a} {b}");
    }
}

#[test]
fn any_split_into_blocks_gives_the_same_triangle() {
    for columns in [0, 1, 2, 3, 4, 5, 6, 9, 13] {
        let rows = random_rows(columns, 333, 7 + columns as u64);
        let mut by_row = Information::new(columns);
        rows.iter().for_each(|(phi, y)| by_row.absorb_row(phi, *y));
        for capacity in [1, 2, 7, 8, 64, 100, 256, 1000] {
            assert_close(&by_row, &absorbed(columns, &rows, capacity), 1e-13);
        }
    }
}
