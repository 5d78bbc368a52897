//! One step of a network for other programs: what is written, and what is refused.

use crate::{Place, sine_with_adam};

fn trained() -> Place {
    let place = Place::with(&sine_with_adam());
    place.ok("train sine.toml --out run --epochs 20");
    place.ok("train sine.toml --out mixture --epochs 20 --set training.members=2");
    place
}

#[test]
fn both_files_are_written_and_named_and_the_same_again() {
    let place = trained();
    assert_eq!(place.ok("export run --onnx a.onnx --c a.h"), "a.h\na.onnx\n");
    place.ok("export run/checkpoint.safetensors --c b.h --onnx b.onnx --sequence mean");
    assert_eq!(place.read("a.h"), place.read("b.h"));
    assert_eq!(place.read("a.onnx"), place.read("b.onnx"));
    assert!(place.text("a.h").contains("from sine, epoch 20."), "{}", place.text("a.h"));
    place.ok("export run --c first.h --sequence 1 --best");
    assert!(place.text("first.h").contains("the initial state of the learned sequence 1."));
    place.ok("export mixture --c mixture.h --onnx mixture.onnx --float32");
    let text = place.text("mixture.h");
    assert!(text.contains("from sine, epochs 20, 20.") && text.contains("#define SCRNN_MEMBERS"), "{text}");
    assert!(place.read("mixture.onnx").len() < place.read("a.onnx").len() * 2);
}

#[test]
fn what_cannot_be_exported_is_refused_and_nothing_is_lost() {
    let place = trained();
    let before = place.read("run/checkpoint.safetensors");
    let member = place.read("mixture/member-2/checkpoint.safetensors");
    let (_, told) = place.fails(2, "export run");
    assert!(told.contains("--c <FILE>"), "{told}");
    place.fails(2, "export run --c a.h --float32");
    let (_, told) = place.fails(2, "export run --c a.h --sequence nod");
    assert!(told.contains("there is no learned sequence nod") && told.contains("the network learned 1"), "{told}");
    for line in [
        "export run --c run/checkpoint.safetensors",
        "export run --onnx run/history.csv",
        "export run --c run",
        "export run/checkpoint.safetensors --c run/checkpoint.safetensors",
        "export mixture --c mixture/member-2/checkpoint.safetensors",
        "export run --c same --onnx ./same",
    ] {
        let (_, told) = place.fails(5, line);
        assert!(told.contains("are one file") && told.contains("give another file"), "{told}");
    }
    assert_eq!(place.read("run/checkpoint.safetensors"), before);
    assert_eq!(place.read("mixture/member-2/checkpoint.safetensors"), member);
    assert!(!place.path("same").exists() && !place.path("a.h").exists());
    place.fails(4, "export run --c nowhere/a.h");
    place.fails(4, "export run --c mixture");
    let (_, told) = place.fails(4, "export nothing --c a.h");
    assert!(told.contains("nothing"), "{told}");
    // Nothing is written where one of two cannot be.
    place.write("run/broken.safetensors", &before[..before.len() - 8]);
    place.fails(2, "export run/broken.safetensors --c a.h --onnx a.onnx");
    assert!(!place.path("a.h").exists() && !place.path("a.onnx").exists());
}
