//! The pin-hole camera that every node looking into a volume has as its field `camera`.
//!
//! A node calls [`Camera::image`] in `outputs`, hands its pass to [`Camera::describe`], and calls `eye_ray` of
//! `shaders/lib/ray.wgsl` with the parameters that this adds; its twin asks [`Camera::view`] for the same rays. Rays live in
//! the unit cube, whatever the proportions of the volume; what is long or perpendicular to the eye is another matter there,
//! and [`View::stretch`] and [`View::seen_at`] (`params.proportions` in shaders) lead back.

use glam::{DMat4, DVec3, Mat4};
use pipe_graph::lowering::PassBuilder;
use pipe_graph::prelude::*;
use smart_default::SmartDefault;

/// A pin-hole camera before the unit cube that a volume fills.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Camera {
    /// Where the eye is.
    #[default([0.5, 0.5, 2.5])]
    eye: [f32; 3],
    /// What is in the middle of the picture.
    #[default([0.5, 0.5, 0.5])]
    target: [f32; 3],
    /// What points up in the picture.
    #[default([0.0, 1.0, 0.0])]
    up: [f32; 3],
    /// Angle from the lower to the upper edge of the picture.
    #[default = 45.0]
    #[schemars(range(min = 0.1, max = 175.0), extend("x-unit" = "°"))]
    fov: f32,
    /// Width and height of the picture.
    #[default([512, 512])]
    #[schemars(extend("x-unit" = "px"))]
    size: [u32; 2],
    /// Replaces eye, target and up: the inverse view matrix of OpenGL, column after column. Its columns are the directions
    /// to the right, up and backward, and the place of the eye.
    matrix: Option<[f32; 16]>,
    /// Lengths of the volume's edges, in any unit: it is seen as a box of these proportions, its longest edge 1, in the middle
    /// of the cube.
    #[default([1.0, 1.0, 1.0])]
    extent: [f32; 3],
}

/// A half-line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ray {
    /// Where it begins.
    pub(crate) origin: DVec3,
    /// Of length 1.
    pub(crate) direction: DVec3,
}

impl Ray {
    /// The point at this distance.
    pub(crate) fn at(&self, distance: f64) -> DVec3 {
        self.origin + distance * self.direction
    }

    /// Distances at which the ray enters and leaves the unit cube, none behind its origin; `None` when it misses.
    pub(crate) fn cube_span(&self) -> Option<[f64; 2]> {
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let (o, d) = (self.origin[axis], self.direction[axis]);
            if d == 0.0 {
                if !(0.0..=1.0).contains(&o) {
                    return None;
                }
                continue;
            }
            let (a, b) = (-o / d, (1.0 - o) / d);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        (enter < leave).then_some([enter, leave])
    }
}

/// A camera's rays, and the size of its picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct View {
    /// Width and height in pixels.
    pub(crate) size: [u32; 2],
    eye: DVec3,
    /// From the middle of the picture to its right edge, the picture being at distance |`forward`|.
    right: DVec3,
    /// From the middle of the picture to its upper edge.
    up: DVec3,
    /// From the eye to the middle of the picture.
    forward: DVec3,
    /// Edges of the box that the volume is seen as.
    proportions: DVec3,
}

impl View {
    /// The ray through the centre of a pixel.
    pub(crate) fn ray(&self, x: i64, y: i64) -> Ray {
        let at = |i: i64, n: u32| (i as f64 + 0.5) * 2.0 / f64::from(n) - 1.0;
        let direction = self.forward + at(x, self.size[0]) * self.right - at(y, self.size[1]) * self.up;
        Ray { origin: self.eye, direction: direction.normalize() }
    }

    /// The length that is seen of a unit of distance along a direction in the cube.
    pub(crate) fn stretch(&self, direction: DVec3) -> f64 {
        (direction * self.proportions).length()
    }

    /// Where a point of the cube is seen.
    pub(crate) fn seen_at(&self, p: DVec3) -> DVec3 {
        (p - 0.5) * self.proportions + 0.5
    }

    /// The gradient that is seen, from one in the cube.
    pub(crate) fn seen_gradient(&self, gradient: DVec3) -> DVec3 {
        gradient / self.proportions
    }

    /// The picture whose every pixel is computed from its ray.
    pub(crate) fn picture(&self, channels: u8, mut f: impl FnMut(Ray) -> [f64; 4]) -> Raster {
        Raster::from_fn(self.size, channels, |x, y| f(self.ray(x, y)))
    }
}

fn mistake(message: &str, hint: &str) -> Mistake {
    Mistake::in_field("camera", message).hint(hint)
}

impl Camera {
    /// The type of the picture, or what is wrong with the camera.
    pub(crate) fn image(&self, channels: u8) -> Result<EdgeType, Mistake> {
        if self.size.contains(&0) {
            return Err(mistake("its picture has no pixels", "expected size: (width, height), each at least 1"));
        }
        if !(0.1..=175.0).contains(&self.fov) {
            return Err(mistake("`fov` is no angle to look through", "expected 0.1° to 175°"));
        }
        if !self.extent.iter().all(|n| *n > 0.0) {
            return Err(mistake("`extent` is no box", "expected three lengths above 0"));
        }
        match self.matrix {
            Some(m) if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] => {
                return Err(mistake("`matrix` is no view", "expected columns one after another, the eye's place in entries 12 to 14"));
            }
            Some(m) if Mat4::from_cols_array(&m).determinant().abs() < 1e-12 => {
                return Err(mistake("`matrix` is singular", "expected three directions that are not in one plane"));
            }
            Some(_) => {}
            None if self.eye == self.target => return Err(mistake("`eye` and `target` are one point", "move the eye away")),
            None => {
                let [eye, target, up] = [self.eye, self.target, self.up].map(|v| glam::Vec3::from(v).as_dvec3());
                if (target - eye).normalize().cross(up.normalize_or_zero()).length() < 1e-6 {
                    return Err(mistake("`up` points along the line of sight", "choose another direction for it"));
                }
            }
        }
        Ok(EdgeType::image(self.size, channels))
    }

    /// The camera's rays; [`Camera::image`] has checked it.
    pub(crate) fn view(&self) -> View {
        let extent = DVec3::from(self.extent.map(f64::from));
        let proportions = extent / extent.max_element();
        let space = match self.matrix {
            Some(m) => DMat4::from_cols_array(&m.map(f64::from)),
            None => {
                let [eye, target, up] = [self.eye, self.target, self.up].map(|v| glam::Vec3::from(v).as_dvec3());
                DMat4::look_at_rh(eye, target, up).inverse()
            }
        };
        let reach = (f64::from(self.fov).to_radians() / 2.0).tan();
        let aspect = f64::from(self.size[0]) / f64::from(self.size[1]);
        View {
            size: self.size,
            eye: (space.w_axis.truncate() - 0.5) / proportions + 0.5,
            right: space.x_axis.truncate() * reach * aspect / proportions,
            up: space.y_axis.truncate() * reach / proportions,
            forward: -space.z_axis.truncate() / proportions,
            proportions,
        }
    }

    /// Tells a pass the rays: `params.eye`, `.right`, `.up` and `.forward`, the arguments of `eye_ray`, and `.proportions`.
    pub(crate) fn describe<'b, 'a>(&self, pass: PassBuilder<'b, 'a>) -> PassBuilder<'b, 'a> {
        let View { eye, right, up, forward, proportions, .. } = self.view();
        [("eye", eye), ("right", right), ("up", up), ("forward", forward), ("proportions", proportions)]
            .into_iter()
            .fold(pass, |pass, (name, v)| pass.param(name, v.as_vec3().to_array()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: DVec3, b: DVec3) -> bool {
        (a - b).length() < 1e-6
    }

    #[test]
    fn the_middle_ray_leads_to_the_target() {
        let camera = Camera { eye: [2.0, 1.0, 0.25], size: [33, 21], ..Camera::default() };
        let ray = camera.view().ray(16, 10);
        assert!(close(ray.at((DVec3::splat(0.5) - ray.origin).length()), DVec3::splat(0.5)));
    }

    #[test]
    fn the_edges_of_the_picture_are_half_the_field_of_view_away() {
        let camera = Camera { fov: 90.0, size: [200, 100], ..Camera::default() };
        let view = camera.view();
        assert!(close(view.forward + view.up, DVec3::new(0.0, 1.0, -1.0)), "the upper edge is 45° up");
        assert!(close(view.right, DVec3::new(2.0, 0.0, 0.0)), "pixels are square");
        let (left, upper) = (view.ray(0, 50).direction, view.ray(100, 0).direction);
        assert!(left.x < 0.0 && upper.y > 0.0, "x grows to the right, y to the top of the world");
    }

    #[test]
    fn a_matrix_is_the_same_camera() {
        let camera = Camera { eye: [1.5, -0.5, 2.0], up: [0.1, 1.0, 0.0], ..Camera::default() };
        let space = glam::Mat4::look_at_rh(camera.eye.into(), camera.target.into(), camera.up.into()).inverse();
        let by_matrix = Camera { matrix: Some(space.to_cols_array()), ..Camera::default() };
        let (a, b) = (camera.view(), by_matrix.view());
        for (x, y) in [(0, 0), (511, 17), (300, 500)] {
            assert!(close(a.ray(x, y).direction, b.ray(x, y).direction) && close(a.eye, b.eye));
        }
    }

    #[test]
    fn a_flat_volume_is_seen_flat() {
        // A box of half the height, seen from the front: rays through its upper edge end at the top of the unit cube.
        let camera = Camera { extent: [2.0, 1.0, 2.0], size: [101, 101], ..Camera::default() };
        let front = |y: i64| {
            let ray = camera.view().ray(50, y);
            ray.at((1.0 - ray.origin.z) / ray.direction.z).y
        };
        let reach = 1.5 * 22.5_f64.to_radians().tan();
        let height = |y: i64| -((y as f64 + 0.5) * 2.0 / 101.0 - 1.0) * reach;
        for y in [10, 50, 80] {
            assert!((front(y) - (0.5 + 2.0 * height(y))).abs() < 1e-6);
        }
    }

    #[test]
    fn rays_meet_the_cube_where_geometry_says() {
        let span = |origin: [f64; 3], direction: [f64; 3]| {
            Ray { origin: origin.into(), direction: DVec3::from(direction).normalize() }
                .cube_span()
                .map(|s| s.map(|t| (t * 1e9).round() / 1e9))
        };
        assert_eq!(span([0.5, 0.5, 2.5], [0.0, 0.0, -1.0]), Some([1.5, 2.5]));
        assert_eq!(span([0.5, 0.5, 0.25], [0.0, 0.0, -1.0]), Some([0.0, 0.25]), "from inside");
        assert_eq!(span([0.5, 0.5, 2.5], [0.0, 0.0, 1.0]), None, "behind the eye");
        assert_eq!(span([1.5, 0.5, 2.5], [0.0, 0.0, -1.0]), None, "beside the cube");
        assert_eq!(span([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]), Some([3.0_f64.sqrt(), 12.0_f64.sqrt()].map(|t| (t * 1e9).round() / 1e9)));
    }

    #[test]
    fn mistakes_are_told() {
        let wrong = |camera: Camera| camera.image(4).unwrap_err().message;
        assert!(wrong(Camera { size: [0, 9], ..Camera::default() }).contains("no pixels"));
        assert!(wrong(Camera { eye: [0.5; 3], ..Camera::default() }).contains("one point"));
        assert!(wrong(Camera { up: [0.0, 0.0, 3.0], ..Camera::default() }).contains("line of sight"));
        let mut rows = Mat4::IDENTITY.to_cols_array();
        (rows[3], rows[12]) = (0.5, 0.0);
        assert!(wrong(Camera { matrix: Some(rows), ..Camera::default() }).contains("no view"), "rows instead of columns");
    }
}
