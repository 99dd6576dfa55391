//! The triangles of marching cubes (W. Lorensen, H. Cline, 1987), derived instead of listed.
//!
//! On every face of a cell the inside corners are cut off by directed segments between the edges that the surface crosses.
//! How a face is cut depends on its own corners only (two opposite inside corners are always cut off apart), so two
//! cells agree about the face they share and the surface has no holes, which the paper's own table does not promise.
//! The segments of a cell link up to loops, and each loop is cut into triangles by diagonals that lie in no face, so that no
//! edge belongs to more than two triangles. All 256 cases can be cut so; a test looks at each.

/// An edge of a cell: its axis, and the corner at its lower end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Edge {
    /// 0 x, 1 y, 2 z.
    pub(super) axis: usize,
    /// Bits x, y, z: whether the corner is at the far end of that axis. The edge's own bit is 0.
    pub(super) corner: usize,
}

impl Edge {
    fn between(a: usize, b: usize) -> Self {
        Self { axis: (a ^ b).trailing_zeros() as usize, corner: a.min(b) }
    }

    /// The edge in a word: axis, far along x, and row (far along y, far along z) of its lower corner.
    fn word(self) -> u32 {
        (self.axis | (self.corner & 1) << 2 | (self.corner >> 1) << 3) as u32
    }
}

/// Words of the table for each case: a number of triangles, then three edges for each.
pub(super) const STRIDE: usize = 16;

/// The corners of each face, counter-clockwise as seen from outside.
fn faces() -> [[usize; 4]; 6] {
    std::array::from_fn(|face| {
        let (axis, far) = (face / 2, face % 2);
        let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        let base = far << axis;
        if far == 1 { [base, base | u, base | u | v, base | v] } else { [base, base | v, base | u | v, base | u] }
    })
}

/// Whether two edges belong to one face.
fn share_a_face(a: Edge, b: Edge) -> bool {
    faces().iter().any(|face| {
        let has = |edge: Edge| (0..4).any(|i| Edge::between(face[i], face[(i + 1) % 4]) == edge);
        has(a) && has(b)
    })
}

/// The loops of crossed edges of a case, whose bit c says whether corner c is inside.
fn loops(case: usize) -> Vec<Vec<Edge>> {
    let inside = |corner: usize| case >> corner & 1 == 1;
    let mut segments: Vec<(Edge, Edge)> = Vec::new();
    for face in faces() {
        for i in 0..4 {
            let (last, next) = (face[i], face[(i + 1) % 4]);
            if !inside(last) || inside(next) {
                continue;
            }
            // Back to where this run of inside corners begins.
            let first = (0..4).map(|back| (i + 4 - back) % 4).find(|j| !inside(face[(j + 3) % 4])).expect("one corner is outside");
            segments.push((Edge::between(face[(first + 3) % 4], face[first]), Edge::between(last, next)));
        }
    }
    let mut found = Vec::new();
    while let Some((start, mut at)) = segments.pop() {
        let mut ring = vec![start];
        while at != start {
            ring.push(at);
            let next = segments.iter().position(|(from, _)| *from == at).expect("every edge belongs to two faces");
            at = segments.swap_remove(next).1;
        }
        found.push(ring);
    }
    found
}

/// Triangles that fill a loop, no diagonal in a face; `None` if there are no such.
fn cut(ring: &[Edge]) -> Option<Vec<[Edge; 3]>> {
    let last = ring.len() - 1;
    if last < 2 {
        return Some(Vec::new());
    }
    (1..last).find_map(|apex| {
        let diagonal = |a: usize, b: usize| b - a > 1 && share_a_face(ring[a], ring[b]);
        if diagonal(0, apex) || diagonal(apex, last) {
            return None;
        }
        let mut triangles = cut(&ring[..=apex])?;
        triangles.extend(cut(&ring[apex..])?);
        triangles.push([ring[0], ring[apex], ring[last]]);
        Some(triangles)
    })
}

/// The triangles of a case, counter-clockwise from outside.
pub(super) fn triangles(case: usize) -> Vec<[Edge; 3]> {
    loops(case).iter().flat_map(|ring| cut(ring).expect("every loop can be cut")).collect()
}

/// All cases as words.
pub(super) fn words() -> Vec<u32> {
    let mut words = vec![0; 256 * STRIDE];
    for (case, row) in words.chunks_exact_mut(STRIDE).enumerate() {
        let triangles = triangles(case);
        row[0] = triangles.len() as u32;
        for (word, edge) in row[1..].iter_mut().zip(triangles.iter().flatten()) {
            *word = edge.word();
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    #[test]
    fn every_case_can_be_cut_into_five_triangles_at_most() {
        for case in 0..256 {
            let triangles = triangles(case);
            assert!(triangles.len() <= 5, "case {case}");
            assert!(triangles.iter().flatten().all(|e| (case >> e.corner ^ case >> (e.corner | 1 << e.axis)) & 1 == 1), "case {case}");
        }
    }

    /// Sides of triangles that are not shared within the cell lie in a face, once in each direction at most; there the
    /// neighbour has the same side in the other direction.
    #[test]
    fn open_sides_lie_in_faces_and_depend_on_nothing_else() {
        let mut by_face: HashMap<(usize, usize), Vec<(Edge, Edge)>> = HashMap::new();
        for case in 0..256 {
            let mut sides: HashMap<(Edge, Edge), i32> = HashMap::new();
            for [a, b, c] in triangles(case) {
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    *sides.entry((from, to)).or_default() += 1;
                }
            }
            assert!(sides.values().all(|n| *n == 1), "case {case} has a side twice");
            let open: Vec<_> = sides.keys().filter(|(a, b)| !sides.contains_key(&(*b, *a))).copied().collect();
            for (number, face) in faces().into_iter().enumerate() {
                let mut here: Vec<_> = open.iter().filter(|(a, b)| [a, b].iter().all(|e| edges(face).contains(e))).copied().collect();
                here.sort();
                let corners = face.iter().fold(0, |bits, corner| bits | (case >> corner & 1) << corner);
                let seen = by_face.entry((number, corners)).or_insert_with(|| here.clone());
                assert_eq!(*seen, here, "case {case}, face {number}");
            }
            assert!(open.iter().all(|(a, b)| share_a_face(*a, *b)), "case {case}");
        }
        // Opposite faces see the same corners from both sides: the sides run the other way.
        for ((face, corners), sides) in &by_face {
            let (axis, far) = (face / 2, face % 2);
            if far == 1 {
                continue;
            }
            let moved = (0..8).filter(|c| corners >> c & 1 == 1).fold(0, |bits, c| bits | 1 << (c | 1 << axis));
            let mut turned: Vec<_> =
                sides.iter().map(|(a, b)| [b, a].map(|e| Edge { corner: e.corner | 1 << axis, ..*e })).map(|[a, b]| (a, b)).collect();
            turned.sort();
            assert_eq!(by_face[&(face + 1, moved)], turned);
        }
    }

    fn edges(face: [usize; 4]) -> [Edge; 4] {
        std::array::from_fn(|i| Edge::between(face[i], face[(i + 1) % 4]))
    }
}
