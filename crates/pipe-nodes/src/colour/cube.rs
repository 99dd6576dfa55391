//! Colour cubes: the .cube format, and tetrahedral interpolation in double precision.

/// A lattice of colours, red fastest.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Cube {
    /// Points along an edge.
    pub(super) size: usize,
    /// The colour that the first point stands for.
    pub(super) low: [f32; 3],
    /// The colour that the last point stands for.
    pub(super) high: [f32; 3],
    /// size³ colours.
    pub(super) values: Vec<[f32; 3]>,
}

impl Cube {
    /// Reads the text of a file (Adobe, Cube LUT Specification 1.0; `LUT_3D_INPUT_RANGE` as Resolve writes it). The
    /// error is a sentence that names the line.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let mut cube = Self { size: 0, low: [0.0; 3], high: [1.0; 3], values: Vec::new() };
        for (number, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if !line.is_empty() {
                cube.line(line).map_err(|what| format!("line {}: {what}", number + 1))?;
            }
        }
        if cube.size == 0 {
            return Err("there is no LUT_3D_SIZE".to_owned());
        }
        let expected = cube.size.pow(3);
        if cube.values.len() != expected {
            return Err(format!("there are {} colours, a cube of size {} has {expected}", cube.values.len(), cube.size));
        }
        if (0..3).any(|i| cube.high[i] <= cube.low[i]) {
            return Err("its domain is empty".to_owned());
        }
        Ok(cube)
    }

    fn line(&mut self, line: &str) -> Result<(), String> {
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match word {
            "TITLE" => {}
            "LUT_3D_SIZE" => {
                let size = rest.trim().parse().ok().filter(|n| (2..=256).contains(n));
                self.size = size.ok_or_else(|| format!("LUT_3D_SIZE is `{}`, expected 2 to 256", rest.trim()))?;
                self.values.reserve_exact(self.size.pow(3));
            }
            "DOMAIN_MIN" => self.low = numbers(rest)?,
            "DOMAIN_MAX" => self.high = numbers(rest)?,
            "LUT_3D_INPUT_RANGE" => {
                let [low, high] = numbers(rest)?;
                (self.low, self.high) = ([low; 3], [high; 3]);
            }
            "LUT_1D_SIZE" | "LUT_1D_INPUT_RANGE" => return Err("a 1D table is no cube".to_owned()),
            _ if self.size == 0 => return Err(format!("`{word}` before LUT_3D_SIZE")),
            _ if self.values.len() == self.size.pow(3) => return Err("more colours than LUT_3D_SIZE says".to_owned()),
            _ => self.values.push(numbers(line)?),
        }
        Ok(())
    }

    fn at(&self, r: usize, g: usize, b: usize) -> [f64; 3] {
        self.values[r + self.size * (g + self.size * b)].map(f64::from)
    }

    /// The colour at `c`, case by case as in the paper.
    pub(super) fn tetrahedral(&self, c: [f64; 3]) -> [f64; 3] {
        if c.iter().any(|v| v.is_nan()) {
            return [f64::NAN; 3];
        }
        let steps = (self.size - 1) as f64;
        let t: [f64; 3] = std::array::from_fn(|i| {
            let (low, high) = (f64::from(self.low[i]), f64::from(self.high[i]));
            ((c[i] - low) / (high - low) * steps).clamp(0.0, steps)
        });
        let base = t.map(|v| (v.floor() as usize).min(self.size - 2));
        let [fr, fg, fb]: [f64; 3] = std::array::from_fn(|i| t[i] - base[i] as f64);
        let corner = |dr, dg, db| self.at(base[0] + dr, base[1] + dg, base[2] + db);
        let (black, white) = (corner(0, 0, 0), corner(1, 1, 1));
        let (first, second, [f1, f2, f3]) = if fr > fg {
            if fg > fb {
                (corner(1, 0, 0), corner(1, 1, 0), [fr, fg, fb])
            } else if fr > fb {
                (corner(1, 0, 0), corner(1, 0, 1), [fr, fb, fg])
            } else {
                (corner(0, 0, 1), corner(1, 0, 1), [fb, fr, fg])
            }
        } else if fb > fg {
            (corner(0, 0, 1), corner(0, 1, 1), [fb, fg, fr])
        } else if fb > fr {
            (corner(0, 1, 0), corner(0, 1, 1), [fg, fb, fr])
        } else {
            (corner(0, 1, 0), corner(1, 1, 0), [fg, fr, fb])
        };
        std::array::from_fn(|i| black[i] * (1.0 - f1) + first[i] * (f1 - f2) + second[i] * (f2 - f3) + white[i] * f3)
    }
}

/// As many finite numbers as asked for.
fn numbers<const N: usize>(text: &str) -> Result<[f32; N], String> {
    let parsed: Option<Vec<f32>> = text.split_whitespace().map(|w| w.parse().ok().filter(|v: &f32| v.is_finite())).collect();
    let parsed = parsed.and_then(|v| v.try_into().ok());
    parsed.ok_or_else(|| format!("`{text}` is not {N} numbers"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> Cube {
        let values = (0..27).map(|i| [((i * 7) % 11) as f32, ((i * 5) % 13) as f32, ((i * 3) % 7) as f32]).collect();
        Cube { size: 3, low: [0.0; 3], high: [1.0; 3], values }
    }

    /// `colour.algebra.table_interpolation_tetrahedral` of colour-science 0.4.
    #[test]
    fn interpolation_is_that_of_colour_science() {
        let expected = [
            ([0.1, 0.2, 0.3], [3.6, 2.8, 2.2]),
            ([0.9, 0.6, 0.4], [9.0, 5.8, 1.4]),
            ([0.3, 0.8, 0.05], [6.7, 5.5, 1.4]),
            ([0.7, 0.2, 0.95], [3.7, 7.5, 3.1]),
            ([0.45, 0.3, 0.4], [3.3, 2.7, 3.1]),
            ([0.6, 0.99, 0.7], [4.42, 2.76, 4.76]),
        ];
        for (c, expected) in expected {
            let got = cube().tetrahedral(c);
            assert!(got.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{c:?}: {got:?}, expected {expected:?}");
        }
    }

    #[test]
    fn mistakes_name_their_line() {
        let of = |text: &str| Cube::parse(text).expect_err("is wrong");
        assert_eq!(of("TITLE \"x\"\n\nLUT_3D_SIZE 1"), "line 3: LUT_3D_SIZE is `1`, expected 2 to 256");
        assert_eq!(of("LUT_3D_SIZE 2\n0 0 x"), "line 2: `0 0 x` is not 3 numbers");
        assert_eq!(of("LUT_3D_SIZE 2\n0 0 0"), "there are 1 colours, a cube of size 2 has 8");
        assert_eq!(of("LUT_1D_SIZE 16"), "line 1: a 1D table is no cube");
        assert_eq!(of("# nothing"), "there is no LUT_3D_SIZE");
    }
}
