//! Recordings, read back by the mcap crate and by hand.

use std::io::{self, Cursor, SeekFrom};

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::*;
use crate::world::scene::{Body, Frame, Part, Shape};

const URDF: &str = r#"<robot name="arm"><link name="base"/><link name="upper"/><link name="hand"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="wrist" type="fixed"><parent link="upper"/><child link="hand"/></joint></robot>"#;

fn channels() -> Vec<String> {
    ["head_yaw", "head_pitch"].map(str::to_owned).to_vec()
}

fn scene(angle: f64) -> Scene {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
    let at = |x: f64, rotation| Isometry3::from_parts(Translation3::new(x, 0.0, 0.5), rotation);
    let body =
        |name: &str, shape| Body { name: name.into(), part: Part::Robot, shape, world_from_shape: at(0.1, turn) };
    let frame = |name: &str, x, rotation| Frame { name: name.into(), world_from_frame: at(x, rotation) };
    Scene {
        bodies: vec![
            body("self/upper", Shape::Capsule { a: Point3::origin(), b: Point3::new(0.1, 0.0, 0.0), radius: 0.02 }),
            body("ball", Shape::Sphere { radius: 0.02 }),
            body("bench", Shape::Cuboid { half_extents: [0.1, 0.3, 0.01] }),
        ],
        frames: vec![
            frame("self/base", 0.0, UnitQuaternion::identity()),
            frame("self/upper", 0.1, turn),
            frame("self/hand", 0.3, turn),
        ],
    }
}

fn record<W: Write + Seek>(out: W) -> Result<W, RecordingError> {
    let channels = channels();
    let heading = Heading {
        robots: &[Robot { prefix: "self/", urdf: URDF }],
        experiment: Some("name = \"reach\"\n"),
        channels: &channels,
        notes: &[("seed", "7"), ("command", "simulate reach")],
    };
    let mut recorder = Recorder::new(out, &heading)?;
    for sequence in 0..2_u64 {
        recorder.begin_sequence(sequence * 10_000_000_000, ["left", "right"][sequence as usize])?;
        for step in 0..50_u64 {
            let time = sequence * 10_000_000_000 + step * 100_000_000;
            let angle = (step as f64 * 0.1).sin();
            recorder.scene(time, &scene(angle))?;
            let shoulder = Joint { name: "shoulder", position: angle, velocity: Some(0.1), effort: None };
            recorder.joint_states(time, &[shoulder, Joint::at("wrist", 0.0)])?;
            recorder.joint_targets(time, &[Joint::at("shoulder", angle + 0.01)])?;
            recorder.sensed(time, &[angle, -angle])?;
            recorder.predicted(time, &[angle, 0.0], Some(&[1e-4, 2.5e-3]))?;
            let touching = [Contact { a: "self/upper", b: "ball", distance: Some(-1e-4), force: Some(1.5) }];
            recorder.contacts(time, if step % 10 == 0 { &touching } else { &[] })?;
            if step % 10 == 0 {
                recorder.event(time, "touch", &[("gap", 1e-3), ("branch", 1.0)])?;
            }
        }
    }
    recorder.finish()
}

fn recording() -> Vec<u8> {
    record(Cursor::new(Vec::new())).unwrap().into_inner()
}

#[test]
fn the_same_calls_give_the_same_bytes() {
    let first = recording();
    for _ in 0..8 {
        assert!(recording() == first);
    }
}

#[test]
fn all_that_was_recorded_is_there() {
    let bytes = recording();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let mut topics: Vec<_> = summary
        .channels
        .values()
        .map(|channel| {
            let schema = channel.schema.as_ref().unwrap();
            (channel.topic.clone(), schema.name.clone(), schema.encoding.clone(), channel.message_encoding.clone())
        })
        .collect();
    topics.sort();
    let named = |topic: &str, schema: &str, encoding: &str, messages: &str| {
        (topic.to_owned(), schema.to_owned(), encoding.to_owned(), messages.to_owned())
    };
    let expected = [
        named("/contacts", "scrnn.Contacts", "jsonschema", "json"),
        named("/events", "scrnn.Event", "jsonschema", "json"),
        named("/joint_states", "foxglove.JointStates", "jsonschema", "json"),
        named("/joint_targets", "foxglove.JointStates", "jsonschema", "json"),
        named("/predicted_mean", "scrnn.Channels", "jsonschema", "json"),
        named("/predicted_variance", "scrnn.Channels", "jsonschema", "json"),
        named("/scene", "foxglove.SceneUpdate", "protobuf", "protobuf"),
        named("/sensed", "scrnn.Channels", "jsonschema", "json"),
        named("/sequence", "scrnn.Sequence", "jsonschema", "json"),
        named("/transforms", "foxglove.FrameTransforms", "protobuf", "protobuf"),
    ];
    assert_eq!(topics, expected);
    let attached: Vec<_> = summary.attachment_indexes.iter().map(|index| index.name.as_str()).collect();
    assert_eq!(attached, ["self/robot.urdf", "experiment.toml"]);
    let robot = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
    assert_eq!(robot.data, URDF.as_bytes());
    let notes = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap().metadata;
    assert_eq!((notes["seed"].as_str(), notes["channels"].as_str()), ("7", r#"["head_yaw","head_pitch"]"#));

    let messages: Vec<mcap::Message<'_>> = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).collect();
    let of = |topic: &str| messages.iter().filter(|message| message.channel.topic == topic).collect::<Vec<_>>();
    assert_eq!((of("/scene").len(), of("/events").len(), of("/sequence").len()), (100, 10, 2));
    let text = |message: &mcap::Message<'_>| String::from_utf8(message.data.to_vec()).unwrap();
    let angle = 0.2_f64.sin();
    assert_eq!(
        text(of("/sensed")[52]),
        format!("{{\"timestamp\":{{\"sec\":10,\"nsec\":200000000}},\"head_yaw\":{angle},\"head_pitch\":{}}}", -angle)
    );
    assert_eq!(of("/sensed")[52].log_time, 10_200_000_000);
    let joints = format!("{{\"name\":\"shoulder\",\"position\":{angle},\"velocity\":0.1}},{{\"name\":\"wrist\"");
    assert!(text(of("/joint_states")[2]).contains(&joints), "{}", text(of("/joint_states")[2]));
    assert_eq!(text(of("/contacts")[1]), "{\"timestamp\":{\"sec\":0,\"nsec\":100000000},\"contacts\":[]}");
}

#[test]
fn what_cannot_be_recorded_is_refused_with_its_topic() {
    let channels = channels();
    let heading = Heading { channels: &channels, ..Heading::default() };
    let mut recorder = Recorder::new(Cursor::new(Vec::new()), &heading).unwrap();
    recorder.sensed(5, &[0.0, 0.0]).unwrap();
    let mut said = |attempt: &dyn Fn(&mut Recorder<_>) -> Result<(), RecordingError>| {
        attempt(&mut recorder).unwrap_err().to_string()
    };
    assert_eq!(
        said(&|recorder| recorder.sensed(6, &[1.0, f64::NAN])),
        "/sensed at 6 ns: head_pitch is NaN; needed: a finite number"
    );
    assert_eq!(
        said(&|recorder| recorder.predicted(6, &[1.0], None)),
        "/predicted_mean at 6 ns: 1 values; needed: 2, one for each channel of the heading"
    );
    assert_eq!(
        said(&|recorder| recorder.event(4, "touch", &[])),
        "/events at 4 ns: the last message is of 5 ns; time does not run backwards"
    );
    assert_eq!(
        said(&|recorder| recorder.joint_states(6, &[Joint::at("a", 0.0), Joint::at("a", 1.0)])),
        "/joint_states: there are two called `a`; a viewer would show one of them"
    );
    let mut bad = scene(0.0);
    bad.frames[1].world_from_frame.translation.vector.y = f64::INFINITY;
    assert_eq!(
        said(&|recorder| recorder.scene(6, &bad)),
        "/transforms at 6 ns: self/upper is inf; needed: a finite number"
    );
    bad.bodies[1].name = "bench".into();
    assert_eq!(
        said(&|recorder| recorder.scene(6, &bad)),
        "/scene: there are two called `bench`; a viewer would show one of them"
    );
    // The recorder goes on after each of them.
    recorder.sensed(6, &[0.0, 0.0]).unwrap();
    let bytes = recorder.finish().unwrap().into_inner();
    assert_eq!(mcap::MessageStream::new(&bytes).unwrap().count(), 2);

    let robots = [Robot { prefix: "self/", urdf: "<robot>" }];
    let refused = Recorder::new(Cursor::new(Vec::new()), &Heading { robots: &robots, ..Heading::default() });
    let Err(refused) = refused else { panic!("half a URDF was taken") };
    assert!(refused.to_string().starts_with("the description of robot `self/` cannot be read: "), "{refused}");
    let timestamp = ["timestamp".to_owned()];
    let refused = Recorder::new(Cursor::new(Vec::new()), &Heading { channels: &timestamp, ..Heading::default() });
    assert!(matches!(refused, Err(RecordingError::Twice { .. })));
}

/// Takes so many bytes, then is full.
struct Small {
    disk: Cursor<Vec<u8>>,
    room: usize,
}

impl Write for Small {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.disk.position() as usize + bytes.len() > self.room {
            return Err(io::Error::from(io::ErrorKind::StorageFull));
        }
        self.disk.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Small {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.disk.seek(to)
    }
}

#[test]
fn a_full_disk_is_an_error_at_every_byte_and_never_a_panic() {
    let whole = recording().len();
    for room in (0..whole).step_by(997).chain([whole - 1]) {
        let error = record(Small { disk: Cursor::new(Vec::new()), room }).err().expect("it does not fit");
        assert!(matches!(error, RecordingError::Write { .. }), "{room} of {whole}: {error}");
    }
    assert!(record(Small { disk: Cursor::new(Vec::new()), room: whole }).is_ok());
}
