//! What a camera sees: places in the world to places in the image.
//!
//! A camera's frame has x along its axis, y to the left and z up. In the image, columns count to the right and rows down,
//! both in pixels from the upper left corner.

use nalgebra::{Isometry3, Point3, Unit, Vector3};

/// A pinhole camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Angle between the left and the right edge, in rad.
    pub horizontal_view: f64,
    /// Angle between the upper and the lower edge, in rad.
    pub vertical_view: f64,
    /// Pixels in a row.
    pub width: f64,
    /// Pixels in a column.
    pub height: f64,
}

impl Camera {
    /// The column and the row of a point; none for a point that is not in front of the camera. The place can lie outside
    /// of the image, see [`Camera::sees`].
    #[must_use]
    pub fn project(&self, world_from_camera: &Isometry3<f64>, point: &Point3<f64>) -> Option<[f64; 2]> {
        let seen = world_from_camera.inverse_transform_point(point);
        let [focal_x, focal_y] = self.focal_lengths();
        (seen.x > 1e-9).then(|| {
            let column = self.width / 2.0 - focal_x * seen.y / seen.x;
            let row = self.height / 2.0 - focal_y * seen.z / seen.x;
            [column, row]
        })
    }

    /// The direction, in the camera's frame, that a place in the image shows.
    #[must_use]
    pub fn direction(&self, [column, row]: [f64; 2]) -> Unit<Vector3<f64>> {
        let [focal_x, focal_y] = self.focal_lengths();
        let (y, z) = ((self.width / 2.0 - column) / focal_x, (self.height / 2.0 - row) / focal_y);
        Unit::new_normalize(Vector3::new(1.0, y, z))
    }

    /// Whether a place lies in the image.
    #[must_use]
    pub fn sees(&self, [column, row]: [f64; 2]) -> bool {
        (0.0..=self.width).contains(&column) && (0.0..=self.height).contains(&row)
    }

    fn focal_lengths(&self) -> [f64; 2] {
        [(self.width, self.horizontal_view), (self.height, self.vertical_view)]
            .map(|(size, view)| size / 2.0 / (view / 2.0).tan())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::nao;

    #[test]
    fn the_axis_meets_the_centre_and_the_views_edges_the_image_s() {
        let camera = nao::CAMERA;
        let place = Isometry3::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.1, 0.4, -0.7));
        let at = |x: f64, y: f64, z: f64| camera.project(&place, &(place * Point3::new(x, y, z)));
        let close = |found: Option<[f64; 2]>, column: f64, row: f64| {
            let [found_column, found_row] = found.unwrap();
            assert!(
                (found_column - column).abs() < 1e-9 && (found_row - row).abs() < 1e-9,
                "{found_column} {found_row}"
            );
        };
        close(at(0.7, 0.0, 0.0), 160.0, 120.0);
        close(at(2.0, 2.0 * (camera.horizontal_view / 2.0).tan(), 0.0), 0.0, 120.0);
        close(at(2.0, 0.0, -2.0 * (camera.vertical_view / 2.0).tan()), 160.0, 240.0);
        assert_eq!(at(-0.1, 0.0, 0.0), None);
        assert!(camera.sees([319.0, 0.0]) && !camera.sees([321.0, 0.0]));
    }

    #[test]
    fn a_direction_leads_back_to_its_pixel() {
        let camera = nao::CAMERA;
        let direction = camera.direction([70.0, 200.0]);
        let [column, row] = camera.project(&Isometry3::identity(), &(direction.into_inner() * 0.4).into()).unwrap();
        assert!((column - 70.0).abs() < 1e-9 && (row - 200.0).abs() < 1e-9);
    }
}
