//! The generators of `lib/random.wgsl` in plain integers.

/// `philox4x32-7` of J. Salmon et al., Parallel Random Numbers: As Easy as 1, 2, 3, 2011.
pub(super) fn philox(counter: [u32; 4], key: [u32; 2]) -> [u32; 4] {
    let (mut c, mut k) = (counter, key);
    for _ in 0..7 {
        let wide = |a: u32, b: u32| {
            let p = u64::from(a) * u64::from(b);
            [p as u32, (p >> 32) as u32]
        };
        let (p, q) = (wide(0xd251_1f53, c[0]), wide(0xcd9e_8d57, c[2]));
        c = [q[1] ^ c[1] ^ k[0], q[0], p[1] ^ c[3] ^ k[1], p[0]];
        k = [k[0].wrapping_add(0x9e37_79b9), k[1].wrapping_add(0xbb67_ae85)];
    }
    c
}

/// The next state of the hybrid Tausworthe generator of GPU Gems 3, chapter 37.
pub(super) fn tausworthe(state: [u32; 4]) -> [u32; 4] {
    let register = |z: u32, [s1, s2, s3]: [u32; 3], mask: u32| ((z & mask) << s3) ^ (((z << s1) ^ z) >> s2);
    [
        register(state[0], [13, 19, 12], 0xffff_fffe),
        register(state[1], [2, 25, 4], 0xffff_fff8),
        register(state[2], [3, 11, 17], 0xffff_fff0),
        state[3].wrapping_mul(1_664_525).wrapping_add(1_013_904_223),
    ]
}

/// A word as a number in 0..1, both excluded.
pub(super) fn open_unit(h: u32) -> f64 {
    (f64::from(h >> 9) + 0.5) / 8_388_608.0
}

/// A word as an exponentially distributed number of mean 1.
pub(super) fn exponential(h: u32) -> f64 {
    let zeros = (h | 1).leading_zeros();
    let y = f64::from(((h | 1) << zeros) >> 8) / 16_777_216.0;
    f64::from(zeros) * std::f64::consts::LN_2 - y.ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the file `kat_vectors` of Random123, the authors' own library.
    #[test]
    fn philox_gives_the_published_words() {
        assert_eq!(philox([0; 4], [0; 2]), [0x5f6f_b709, 0x0d89_3f64, 0x4f12_1f81, 0x4f73_0a48]);
        assert_eq!(philox([u32::MAX; 4], [u32::MAX; 2]), [0x5207_ddc2, 0x4516_5e59, 0x4d8e_e751, 0x8c52_f662]);
        assert_eq!(
            philox([0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344], [0xa409_3822, 0x299f_31d0]),
            [0x4dfc_caba, 0x190a_87f0, 0xc473_62ba, 0xb6b5_242a]
        );
    }

    #[test]
    fn numbers_have_the_moments_of_their_distributions() {
        for hybrid in [false, true] {
            let n = 200_000;
            let mut state = [200, 300, 400, 500];
            let (mut mean, mut path, mut square) = (0.0, 0.0, 0.0);
            for i in 0..n {
                state = tausworthe(state);
                let word = if hybrid { state.into_iter().fold(0, |a, b| a ^ b) } else { philox([i, 0, 0, 0], [7, 8])[1] };
                mean += open_unit(word) / f64::from(n);
                path += exponential(word) / f64::from(n);
                square += exponential(word).powi(2) / f64::from(n);
            }
            // Four standard errors.
            let bound = 4.0 / f64::from(n).sqrt();
            assert!((mean - 0.5).abs() < bound * (1.0_f64 / 12.0).sqrt(), "{mean}");
            assert!((path - 1.0).abs() < bound, "{path}");
            assert!((square - 2.0).abs() < bound * 20.0_f64.sqrt(), "{square}");
        }
    }
}
