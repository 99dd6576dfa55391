//! The median of an odd number of values by comparisons that do not depend on them, so that a shader needs no array and no
//! branch.
//!
//! Of (n + 3)/2 of n values neither the smallest nor the largest can be the median: they are forgotten, the next value comes
//! in, and so on until one is left (J. Devillard, Fast median search, 1998).

use std::fmt::Write as _;

/// What makes a value; values are numbered by their steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Step {
    /// This input.
    Input(usize),
    /// The smaller of two values.
    Smaller(usize, usize),
    /// The larger of two values.
    Larger(usize, usize),
}

/// Steps whose last makes the median.
#[derive(Debug, Default)]
pub(super) struct Network {
    steps: Vec<Step>,
}

impl Network {
    /// The median of `n` values, `n` odd.
    pub(super) fn median(n: usize) -> Self {
        let mut network = Self::default();
        let mut kept: Vec<usize> = Vec::new();
        for input in 0..n {
            kept.push(network.push(Step::Input(input)));
            // With n − input − 1 to come, more than half of all are on one side of each extreme.
            if kept.len() == n - input + 2 {
                kept = network.forget_extremes(&kept);
            }
        }
        network.without_unused(kept[0])
    }

    fn push(&mut self, step: Step) -> usize {
        self.steps.push(step);
        self.steps.len() - 1
    }

    /// (smaller, larger)
    fn order(&mut self, a: usize, b: usize) -> (usize, usize) {
        (self.push(Step::Smaller(a, b)), self.push(Step::Larger(a, b)))
    }

    /// At least three values without their smallest and largest.
    fn forget_extremes(&mut self, values: &[usize]) -> Vec<usize> {
        let (mut low, mut high): (Vec<usize>, Vec<usize>) = values.chunks_exact(2).map(|pair| self.order(pair[0], pair[1])).unzip();
        let mut smallest = low.remove(0);
        if let [odd] = *values.chunks_exact(2).remainder() {
            // The larger of the two stands for the odd one among the candidates for the largest.
            let (smaller, larger) = self.order(smallest, odd);
            smallest = smaller;
            high.push(larger);
        }
        let mut kept = Vec::new();
        for value in low {
            let (smaller, larger) = self.order(smallest, value);
            smallest = smaller;
            kept.push(larger);
        }
        let mut largest = high.remove(0);
        for value in high {
            let (smaller, larger) = self.order(largest, value);
            largest = larger;
            kept.push(smaller);
        }
        kept
    }

    /// The steps that `result` needs.
    fn without_unused(self, result: usize) -> Self {
        let mut used = vec![false; self.steps.len()];
        used[result] = true;
        for i in (0..=result).rev().filter(|i| matches!(self.steps[*i], Step::Smaller(..) | Step::Larger(..))) {
            if let (true, Step::Smaller(a, b) | Step::Larger(a, b)) = (used[i], self.steps[i]) {
                used[a] = true;
                used[b] = true;
            }
        }
        let mut place = vec![0; self.steps.len()];
        let mut steps = Vec::new();
        for i in (0..=result).filter(|i| used[*i]) {
            place[i] = steps.len();
            steps.push(match self.steps[i] {
                Step::Input(n) => Step::Input(n),
                Step::Smaller(a, b) => Step::Smaller(place[a], place[b]),
                Step::Larger(a, b) => Step::Larger(place[a], place[b]),
            });
        }
        Self { steps }
    }

    /// WGSL statements, one a step; `v` and a number are its values. `input` is the expression of an input.
    pub(super) fn wgsl(&self, input: impl Fn(usize) -> String) -> String {
        let mut text = String::new();
        for (i, step) in self.steps.iter().enumerate() {
            let _ = match *step {
                Step::Input(n) => writeln!(text, "    let v{i} = {};", input(n)),
                Step::Smaller(a, b) => writeln!(text, "    let v{i} = min(v{a}, v{b});"),
                Step::Larger(a, b) => writeln!(text, "    let v{i} = max(v{a}, v{b});"),
            };
        }
        text
    }

    /// The number of the result.
    pub(super) fn result(&self) -> usize {
        self.steps.len() - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(network: &Network, inputs: &[u64]) -> u64 {
        let mut values: Vec<u64> = Vec::new();
        for step in &network.steps {
            values.push(match *step {
                Step::Input(n) => inputs[n],
                Step::Smaller(a, b) => values[a].min(values[b]),
                Step::Larger(a, b) => values[a].max(values[b]),
            });
        }
        values[network.result()]
    }

    /// A network of comparisons that is right for all zeros and ones is right for all values (Knuth, TAOCP 3, 5.3.4).
    #[test]
    fn of_nine_the_fifth() {
        let network = Network::median(9);
        for bits in 0..1_u64 << 9 {
            let inputs: Vec<u64> = (0..9).map(|i| bits >> i & 1).collect();
            assert_eq!(run(&network, &inputs), u64::from(bits.count_ones() >= 5));
        }
    }

    #[test]
    fn of_many_the_middle() {
        for n in [3, 5, 25, 49] {
            let network = Network::median(n);
            let mut state = 1_u64;
            for _ in 0..5000 {
                let mut inputs: Vec<u64> = Vec::new();
                for _ in 0..n {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    inputs.push(state >> 59);
                }
                let got = run(&network, &inputs);
                inputs.sort_unstable();
                assert_eq!(got, inputs[n / 2]);
            }
        }
    }
}
