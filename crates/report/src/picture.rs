//! Pictures of scenes: spheres, capsules and boxes in perspective, as SVG.
//!
//! Bodies are painted from the farthest to the nearest. What stands around comes first: it lies under or behind all else.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Point3, Vector3};
use scrnn_sim::world::scene::{Body, Part, Scene, Shape};

use super::chart::{TEXT, Tone, WIDTH, csv_field};
use super::escape::escaped;

/// Pictures in rows, all from one point of view and in one scale.
#[derive(Debug, Clone, PartialEq)]
pub struct Pictures {
    /// Pictures in a row.
    pub columns: usize,
    /// From where.
    pub view: View,
    /// The pictures.
    pub pictures: Vec<Picture>,
}

/// One picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Stands above it.
    pub title: String,
    /// What is to be seen.
    pub scene: Scene,
    /// Other moments, of which the hands are shown pale.
    pub pale: Vec<Scene>,
}

/// From where and whereto somebody looks; up is z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// In metres, in the world.
    pub eye: [f64; 3],
    /// In metres, in the world.
    pub target: [f64; 3],
}

/// A body as it is painted.
struct Painted<'a> {
    body: &'a Body,
    distance: f64,
    pale: bool,
    form: Form,
}

/// A body's outline on the picture's plane, at distance 1 from the eye; y points down.
enum Form {
    Disc {
        centre: (f64, f64),
        radius: f64,
    },
    /// Two discs and what lies between them.
    Bar {
        a: (f64, f64),
        b: (f64, f64),
        radii: (f64, f64),
    },
    /// Faces that look at the eye, each by its corners.
    Faces(Vec<Vec<(f64, f64)>>),
}

/// Where the picture's plane lies on the paper.
struct Paper {
    left: f64,
    top: f64,
    scale: f64,
    low: (f64, f64),
}

const GAP: f64 = 16.0;
const CAPTION: f64 = 58.0;
/// Points on the rim of a cylinder.
const RIM: i32 = 32;

impl Pictures {
    /// As one SVG element; colours are those of the light theme.
    pub(super) fn svg(&self, title: &str) -> String {
        let columns = self.columns.max(1);
        let painted: Vec<Vec<Painted<'_>>> = self.pictures.iter().map(|picture| self.painted(picture)).collect();
        let (mut low, mut high) = ((f64::INFINITY, f64::INFINITY), (f64::NEG_INFINITY, f64::NEG_INFINITY));
        for (x, y) in painted.iter().flatten().filter(|painted| painted.body.part != Part::Furniture).flat_map(corners)
        {
            (low, high) = ((low.0.min(x), low.1.min(y)), (high.0.max(x), high.1.max(y)));
        }
        let (across, down) = ((high.0 - low.0).max(1e-9), (high.1 - low.1).max(1e-9));
        let width = (f64::from(WIDTH) - GAP * (columns + 1) as f64) / columns as f64;
        let scale = width / across;
        let row = CAPTION + scale * down + GAP;
        let height = row * self.pictures.len().div_ceil(columns) as f64;
        let mut out = format!(
            "<svg viewBox=\"0 0 {WIDTH} {height:.0}\" xmlns=\"http://www.w3.org/2000/svg\" role=\"img\">\n<title>{}</title>\n",
            escaped(title)
        );
        for (index, (picture, mut bodies)) in self.pictures.iter().zip(painted).enumerate() {
            let left = GAP + (width + GAP) * (index % columns) as f64;
            let top = row * (index / columns) as f64;
            let paper = Paper { left, top: top + CAPTION, scale, low };
            bodies.sort_by(|a, b| {
                let furniture = |painted: &Painted<'_>| painted.body.part == Part::Furniture;
                furniture(b).cmp(&furniture(a)).then(b.distance.total_cmp(&a.distance))
            });
            // Each picture is a window of its own: what stands around may be larger than it.
            writeln!(
                out,
                "<svg x=\"{left:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"{:.1}\" viewBox=\"{left:.1} {:.1} {width:.1} {:.1}\">",
                paper.top,
                scale * down,
                paper.top,
                scale * down
            )
            .expect("a string takes all");
            bodies.iter().for_each(|painted| painted.draw(&paper, &mut out));
            out += "</svg>\n";
            let middle = left + 0.5 * width;
            let (y, size, ink) = (top + 0.72 * CAPTION, 0.86 * TEXT, Tone::Ink.hex());
            writeln!(
                out,
                "<text x=\"{middle:.1}\" y=\"{y:.1}\" text-anchor=\"middle\" font-family=\"sans-serif\" font-size=\"{size:.1}\" \
                 fill=\"{ink}\">{}</text>",
                escaped(&picture.title)
            )
            .expect("a string takes all");
        }
        out += "</svg>\n";
        out
    }

    /// Where each body's origin is: picture, moment (0 is the one that is shown in full), body, x, y, z in metres.
    pub(super) fn csv(&self) -> String {
        let mut text = "picture,moment,body,x,y,z\n".to_owned();
        for picture in &self.pictures {
            let moments = std::iter::once(&picture.scene).chain(&picture.pale);
            for (moment, body) in
                moments.enumerate().flat_map(|(k, scene)| scene.bodies.iter().map(move |body| (k, body)))
            {
                let at = body.world_from_shape.translation.vector;
                let (title, name) = (csv_field(&picture.title), csv_field(&body.name));
                writeln!(text, "{title},{moment},{name},{:?},{:?},{:?}", at.x, at.y, at.z).expect("a string takes all");
            }
        }
        text
    }

    fn painted<'a>(&self, picture: &'a Picture) -> Vec<Painted<'a>> {
        let eye_from_world =
            Isometry3::look_at_rh(&Point3::from(self.view.eye), &Point3::from(self.view.target), &Vector3::z());
        let paint = |body: &'a Body, pale| painted(body, pale, &eye_from_world);
        let full = picture.scene.bodies.iter().filter_map(|body| paint(body, false));
        let pale = picture.pale.iter().flat_map(|scene| &scene.bodies).filter(|body| body.part == Part::Hand);
        full.chain(pale.filter_map(|body| paint(body, true))).collect()
    }
}

/// A body seen by an eye that looks along -z; none if it is not wholly before the eye.
fn painted<'a>(body: &'a Body, pale: bool, eye_from_world: &Isometry3<f64>) -> Option<Painted<'a>> {
    let eye_from_shape = eye_from_world * body.world_from_shape;
    let seen = |point: Point3<f64>| {
        let at = eye_from_shape * point;
        (at.z < -1e-3).then(|| ((at.x / -at.z, at.y / at.z), -at.z))
    };
    let (form, distance) = match &body.shape {
        Shape::Sphere { radius } => {
            let (centre, distance) = seen(Point3::origin())?;
            (Form::Disc { centre, radius: radius / distance }, distance)
        }
        Shape::Capsule { a, b, radius } => {
            let ((a, near), (b, far)) = (seen(*a)?, seen(*b)?);
            (Form::Bar { a, b, radii: (radius / near, radius / far) }, 0.5 * (near + far))
        }
        Shape::Cylinder { half_length, radius } => {
            let rim = |k: i32, end: f64| {
                let angle = std::f64::consts::TAU * f64::from(k) / f64::from(RIM);
                seen(Point3::new(radius * angle.cos(), radius * angle.sin(), end * half_length)).map(|(at, _)| at)
            };
            let around: Option<Vec<_>> = (0..RIM).flat_map(|k| [rim(k, -1.0), rim(k, 1.0)]).collect();
            (Form::Faces(vec![hull(around?)]), seen(Point3::origin())?.1)
        }
        Shape::Cuboid { half_extents } => {
            let half = Vector3::from(*half_extents);
            let mut faces = Vec::new();
            for axis in 0..3 {
                for side in [-1.0, 1.0] {
                    let mut normal = Vector3::zeros();
                    normal[axis] = side;
                    let (first, second) = ((axis + 1) % 3, (axis + 2) % 3);
                    let corner = |s: f64, t: f64| {
                        let mut at = normal.component_mul(&half);
                        (at[first], at[second]) = (s * half[first], t * half[second]);
                        Point3::from(at)
                    };
                    let middle = eye_from_shape * Point3::from(normal.component_mul(&half));
                    // A face is seen if its outside looks towards the eye, which is at the origin.
                    if (eye_from_shape * normal).dot(&middle.coords) < 0.0 {
                        let around = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
                        let around = around.map(|(s, t)| seen(corner(s, t)).map(|(at, _)| at));
                        faces.push(around.into_iter().collect::<Option<Vec<_>>>()?);
                    }
                }
            }
            (Form::Faces(faces), seen(Point3::origin())?.1)
        }
    };
    Some(Painted { body, distance, pale, form })
}

/// Points that span an outline.
fn corners(painted: &Painted<'_>) -> Vec<(f64, f64)> {
    let around = |(x, y): (f64, f64), r: f64| vec![(x - r, y - r), (x + r, y + r)];
    match &painted.form {
        Form::Disc { centre, radius } => around(*centre, *radius),
        Form::Bar { a, b, radii } => [around(*a, radii.0), around(*b, radii.1)].concat(),
        Form::Faces(faces) => faces.iter().flatten().copied().collect(),
    }
}

impl Paper {
    fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.left + self.scale * (x - self.low.0), self.top + self.scale * (y - self.low.1))
    }
}

impl Painted<'_> {
    fn draw(&self, paper: &Paper, out: &mut String) {
        let fill = match self.body.part {
            Part::Robot => Tone::Grid,
            Part::Hand => Tone::Ours,
            Part::OtherRobot => Tone::Level(1),
            Part::Object => Tone::Failed,
            Part::Furniture => Tone::Truth,
        };
        let solid = match self.body.part {
            Part::Furniture => 0.16,
            _ if self.pale => 0.22,
            _ => 1.0,
        };
        let style = format!(
            "fill=\"{}\" stroke=\"{}\" stroke-width=\"1.5\" stroke-linejoin=\"round\" opacity=\"{solid}\"",
            fill.hex(),
            Tone::Data.hex()
        );
        match &self.form {
            Form::Disc { centre, radius } => {
                let (x, y) = paper.at(*centre);
                write!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{:.1}\" {style}>", radius * paper.scale)
            }
            Form::Bar { a, b, radii } => {
                let path = bar(paper.at(*a), paper.at(*b), (radii.0 * paper.scale, radii.1 * paper.scale));
                write!(out, "<path d=\"{path}\" {style}>")
            }
            Form::Faces(faces) => {
                let mut path = String::new();
                for face in faces {
                    for (k, corner) in face.iter().enumerate() {
                        let (x, y) = paper.at(*corner);
                        write!(path, "{}{x:.1} {y:.1}", if k == 0 { 'M' } else { 'L' }).expect("a string takes all");
                    }
                    path.push('Z');
                }
                write!(out, "<path d=\"{path}\" {style}>")
            }
        }
        .expect("a string takes all");
        let end = if matches!(self.form, Form::Disc { .. }) { "circle" } else { "path" };
        writeln!(out, "<title>{}</title></{end}>", escaped(&self.body.name)).expect("a string takes all");
    }
}

/// The corners of the smallest convex outline around points, one way round.
fn hull(mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let turn = |a: (f64, f64), b: (f64, f64), c: (f64, f64)| (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0);
    // From left to right along one side, and back along the other.
    let side = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        let mut side: Vec<(f64, f64)> = Vec::new();
        for point in points {
            while let [.., a, b] = side[..]
                && turn(a, b, point) <= 0.0
            {
                side.pop();
            }
            side.push(point);
        }
        side.pop();
        side
    };
    let mut around = side(&mut points.iter().copied());
    around.extend(side(&mut points.iter().rev().copied()));
    around
}

/// The outline of two discs and what lies between them: the common tangents outside, and an arc around each end.
fn bar(a: (f64, f64), b: (f64, f64), (ra, rb): (f64, f64)) -> String {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let length = dx.hypot(dy);
    if length <= (ra - rb).abs() + 1e-9 {
        let ((x, y), r) = if ra > rb { (a, ra) } else { (b, rb) };
        return format!(
            "M{:.1} {y:.1}a{r:.1} {r:.1} 0 1 0 {:.1} 0a{r:.1} {r:.1} 0 1 0 {:.1} 0Z",
            x - r,
            2.0 * r,
            -2.0 * r
        );
    }
    // The tangent touches both discs at this angle from the axis.
    let tilt = ((ra - rb) / length).clamp(-1.0, 1.0).acos();
    let axis = dy.atan2(dx);
    let on = |(x, y): (f64, f64), r: f64, angle: f64| (x + r * angle.cos(), y + r * angle.sin());
    let (left_a, right_a) = (on(a, ra, axis + tilt), on(a, ra, axis - tilt));
    let (left_b, right_b) = (on(b, rb, axis + tilt), on(b, rb, axis - tilt));
    // The arc around the larger end is the longer one.
    let large = |bigger: bool| u8::from(bigger);
    format!(
        "M{:.1} {:.1}L{:.1} {:.1}A{rb:.1} {rb:.1} 0 {} 1 {:.1} {:.1}L{:.1} {:.1}A{ra:.1} {ra:.1} 0 {} 1 {:.1} {:.1}Z",
        right_a.0,
        right_a.1,
        right_b.0,
        right_b.1,
        large(rb > ra),
        left_b.0,
        left_b.1,
        left_a.0,
        left_a.1,
        large(ra > rb),
        right_a.0,
        right_a.1
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(name: &str, part: Part, shape: Shape, at: [f64; 3]) -> Body {
        Body { name: name.into(), part, shape, world_from_shape: Isometry3::translation(at[0], at[1], at[2]) }
    }

    fn pictures() -> Pictures {
        let arm = Shape::Capsule { a: Point3::origin(), b: Point3::new(0.0, 0.2, 0.0), radius: 0.03 };
        let scene = |y: f64| Scene {
            bodies: vec![
                body("ball", Part::Object, Shape::Sphere { radius: 0.05 }, [0.0, y, 0.0]),
                body("arm", Part::Hand, arm.clone(), [0.2, 0.0, 0.0]),
                body("bench", Part::Furniture, Shape::Cuboid { half_extents: [0.4, 0.4, 0.02] }, [0.0, 0.0, -0.1]),
            ],
            frames: Vec::new(),
        };
        let pictures = vec![
            Picture { title: "near & far".into(), scene: scene(0.0), pale: vec![scene(0.1)] },
            Picture { title: "b".into(), scene: scene(0.3), pale: Vec::new() },
        ];
        Pictures { columns: 2, view: View { eye: [1.0, 0.0, 0.5], target: [0.0; 3] }, pictures }
    }

    #[test]
    fn near_bodies_cover_far_ones_and_all_else_covers_furniture() {
        let svg = pictures().svg("Two scenes");
        let at = |part: &str| svg.find(part).unwrap_or_else(|| panic!("{part} is missing in\n{svg}"));
        assert!(at("<title>bench") < at("<title>ball") && at("<title>ball") < at("<title>arm"));
        assert!(svg.contains("near &amp; far") && svg.contains("<title>Two scenes</title>") && !svg.contains("NaN"));
        // Hands of other moments are there, pale; their objects are not.
        assert_eq!(svg.matches("<title>arm").count(), 3);
        assert_eq!(svg.matches("<title>ball").count(), 2);
        assert_eq!(svg.matches("opacity=\"0.22\"").count(), 1);
    }

    #[test]
    fn the_csv_says_where_every_body_is() {
        let csv = pictures().csv();
        assert!(csv.starts_with("picture,moment,body,x,y,z\nnear & far,0,ball,0.0,0.0,0.0\n"), "{csv}");
        assert!(csv.contains("near & far,1,ball,0.0,0.1,0.0\n") && csv.lines().count() == 1 + 9);
    }

    #[test]
    fn what_lies_behind_the_eye_is_not_painted() {
        let ball = body("ball", Part::Object, Shape::Sphere { radius: 0.05 }, [3.0, 0.0, 0.0]);
        let view = Isometry3::look_at_rh(&Point3::new(1.0, 0.0, 0.0), &Point3::origin(), &Vector3::z());
        assert!(painted(&ball, false, &view).is_none());
    }

    #[test]
    fn a_sphere_has_the_size_of_its_angle() {
        let ball = body("ball", Part::Object, Shape::Sphere { radius: 0.1 }, [0.0, 0.5, 0.0]);
        let view = Isometry3::look_at_rh(&Point3::new(2.0, 0.0, 0.0), &Point3::origin(), &Vector3::z());
        let Form::Disc { centre, radius } = painted(&ball, false, &view).unwrap().form else { panic!("a disc") };
        // Seen from +x, +y lies to the right.
        assert!((centre.0 - 0.25).abs() < 1e-12 && centre.1.abs() < 1e-12 && (radius - 0.05).abs() < 1e-12);
    }

    #[test]
    fn a_cylinder_from_the_side_is_a_bar_without_round_ends() {
        let square = vec![(0.0, 0.0), (1.0, 1.0), (0.5, 0.4), (1.0, 0.0), (0.0, 1.0), (0.5, 0.0)];
        assert_eq!(hull(square), [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]);
        let can = body("can", Part::Object, Shape::Cylinder { half_length: 0.1, radius: 0.05 }, [0.0; 3]);
        let view = Isometry3::look_at_rh(&Point3::new(100.0, 0.0, 0.0), &Point3::origin(), &Vector3::z());
        let outline = corners(&painted(&can, false, &view).unwrap());
        let widest = |of: fn(&(f64, f64)) -> f64| outline.iter().map(of).fold(0.0, f64::max) * 100.0;
        assert!((widest(|at| at.0) - 0.05).abs() < 1e-4 && (widest(|at| at.1) - 0.1).abs() < 1e-4);
    }

    #[test]
    fn a_bar_of_equal_ends_has_straight_sides() {
        assert_eq!(
            bar((0.0, 0.0), (10.0, 0.0), (2.0, 2.0)),
            "M0.0 -2.0L10.0 -2.0A2.0 2.0 0 0 1 10.0 2.0L0.0 2.0A2.0 2.0 0 0 1 0.0 -2.0Z"
        );
        assert!(bar((0.0, 0.0), (1.0, 0.0), (5.0, 2.0)).starts_with("M-5.0 0.0a5.0"));
    }
}
