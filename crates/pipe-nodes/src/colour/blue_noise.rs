//! An array of thresholds whose pattern has no low frequencies: void-and-cluster (R. Ulichney, 1993).
//!
//! 4096 ranks on a torus. Each is placed where it disturbs the ones before it least: in the largest void. Made when it is
//! first asked for, in integers, so that it is the same on every machine; a file of the ranks was rejected because nobody
//! could check it.

use std::sync::OnceLock;

/// Pixels along an edge of the tile.
pub(super) const SIDE: usize = 64;

const AREA: usize = SIDE * SIDE;

/// Distance at which a point's influence ends.
const RADIUS: i64 = 8;

/// A tile of ranks 0..4096, each once, row by row.
pub(super) fn ranks() -> &'static [u16] {
    static RANKS: OnceLock<Vec<u16>> = OnceLock::new();
    RANKS.get_or_init(void_and_cluster)
}

/// Which points are set, and how crowded every place is.
struct Pattern {
    set: Vec<bool>,
    crowding: Vec<u32>,
    /// exp(−d²/2σ²), σ = 1.5, in 2^−20, by offset.
    influence: Vec<(i64, i64, u32)>,
}

impl Pattern {
    fn new() -> Self {
        let weight = |d2: i64| ((-(d2 as f64) / (2.0 * 1.5 * 1.5)).exp() * f64::from(1 << 20)).round() as u32;
        let offsets = (-RADIUS..=RADIUS).flat_map(|y| (-RADIUS..=RADIUS).map(move |x| (x, y)));
        let influence = offsets.map(|(x, y)| (x, y, weight(x * x + y * y))).filter(|(_, _, w)| *w > 0).collect();
        Self { set: vec![false; AREA], crowding: vec![0; AREA], influence }
    }

    fn put(&mut self, at: usize, on: bool) {
        self.set[at] = on;
        let (x0, y0) = ((at % SIDE) as i64, (at / SIDE) as i64);
        let side = SIDE as i64;
        for (dx, dy, weight) in &self.influence {
            let place = ((y0 + dy).rem_euclid(side) * side + (x0 + dx).rem_euclid(side)) as usize;
            if on {
                self.crowding[place] += weight;
            } else {
                self.crowding[place] -= weight;
            }
        }
    }

    fn largest_void(&self) -> usize {
        (0..AREA).filter(|i| !self.set[*i]).min_by_key(|i| self.crowding[*i]).unwrap_or(0)
    }

    fn tightest_cluster(&self) -> usize {
        (0..AREA).filter(|i| self.set[*i]).max_by_key(|i| self.crowding[*i]).unwrap_or(0)
    }
}

fn void_and_cluster() -> Vec<u16> {
    let mut pattern = Pattern::new();
    // A tenth of the points at random (an LCG of Numerical Recipes), then moved from clusters to voids until at rest.
    let mut state = 1_u32;
    let first = AREA / 10;
    let mut placed = 0;
    while placed < first {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let at = state as usize >> 20;
        if !pattern.set[at] {
            pattern.put(at, true);
            placed += 1;
        }
    }
    for _ in 0..AREA {
        let cluster = pattern.tightest_cluster();
        pattern.put(cluster, false);
        let void = pattern.largest_void();
        pattern.put(void, true);
        if void == cluster {
            break;
        }
    }
    let mut ranks = vec![0; AREA];
    // Downwards from there: the most crowded point was the last to come.
    let start = pattern.set.clone();
    for rank in (0..first).rev() {
        let cluster = pattern.tightest_cluster();
        pattern.put(cluster, false);
        ranks[cluster] = rank as u16;
    }
    // And upwards. On a torus the tightest cluster of what is unset is the largest void of what is set.
    for at in (0..AREA).filter(|i| start[*i]) {
        pattern.put(at, true);
    }
    for rank in first..AREA {
        let void = pattern.largest_void();
        pattern.put(void, true);
        ranks[void] = rank as u16;
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rank_stands_once() {
        let mut sorted = ranks().to_vec();
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, r)| i == usize::from(*r)));
    }

    /// Means over 8×8 tiles vary less than a third as much as those of white noise, whose deviation is 4096/√12/8 = 148.
    #[test]
    fn there_are_no_low_frequencies() {
        let tile = |x: usize, y: usize| -> f64 {
            let pixels = (0..8).flat_map(|j| (0..8).map(move |i| (y * 8 + j) * SIDE + x * 8 + i));
            pixels.map(|at| f64::from(ranks()[at])).sum::<f64>() / 64.0 - (AREA as f64 - 1.0) / 2.0
        };
        let square: f64 = (0..8).flat_map(|y| (0..8).map(move |x| (x, y))).map(|(x, y)| tile(x, y).powi(2)).sum();
        let deviation = (square / 64.0).sqrt();
        assert!(deviation < 148.0 / 3.0, "{deviation}");
    }
}
