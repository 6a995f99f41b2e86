//! The micro-stage's chapter.

use kalmems::progress::Silent;
use kalmems_papers::program::{Check, Effort, ItemVerdict, ReproductionSettings, reproduce};

/// Every item is there; what the chapter's model must give, and what it cannot.
#[test]
fn the_chapter_is_set_beside_ours() {
    let settings = ReproductionSettings { only: None, effort: Effort::Quick, seed: 1, threads: 2 };
    let found =
        reproduce("micro_stage", kalmems_papers::of("micro_stage").unwrap(), settings, &Silent).unwrap();
    for item in &found.items {
        println!("{}: {:?}: {}", item.head.key, item.verdict(), item.why());
        for check in &item.checks {
            println!(
                "    {}: paper {}, ours {}, {}",
                check.subject(),
                check.paper(),
                check.ours(),
                check.comparison()
            );
        }
    }
    let holds = |key: &str| -> Vec<bool> {
        let item = found.items.iter().find(|item| item.head.key == key).unwrap();
        item.checks.iter().map(Check::holds).collect()
    };
    // The motion at 1.0 V is not that of a linear stage; 1.3 V and the top of the sweep are.
    assert_eq!(holds("table-3-2")[2..], [false, true]);
    assert!(holds("figure-3-11").iter().all(|h| *h) && holds("table-3-3").iter().all(|h| *h));
    assert!(holds("figure-3-12").iter().all(|h| *h));
    // 99.998, 99.98 and 99.88 %, where the first is printed as the second and the last as 99.90.
    assert_eq!(holds("table-3-4"), [false, true, false]);
    // An error without hardware's is not the printed one, nor is its scale factor.
    assert_eq!(holds("table-3-5"), [false, false, true]);
    // The simulated stage has the printed resonance, gaps and gains: that they come back says nothing of the chapter.
    for key in ["figure-3-11", "table-3-3", "table-3-1"] {
        let item = found.items.iter().find(|item| item.head.key == key).unwrap();
        let circular = item.checks.iter().filter(|check| check.is_circular()).count();
        assert_eq!((circular, item.verdict()), (item.checks.len(), ItemVerdict::Circular), "{key}");
    }
    assert!(holds("table-3-1").iter().all(|h| *h) && holds("table-3-6").iter().all(|h| *h));
    // Theirs is the error of hardware; ours is below what others report.
    assert!(holds("table-3-7")[1]);
    assert!(holds("figure-3-16").iter().all(|h| *h));
}

/// 24 sets of records at two temperatures: by vibrometer and stage, and by the stage that found its gaps again in place.
#[test]
#[ignore = "a study over 24 sets"]
fn slow_two_temperatures_and_the_gaps_found_in_place() {
    let only = Some("Table 3.6".to_owned());
    let settings = ReproductionSettings { only, effort: Effort::Full, seed: 1, threads: 2 };
    let found =
        reproduce("micro_stage", kalmems_papers::of("micro_stage").unwrap(), settings, &Silent).unwrap();
    let [item] = &found.items[..] else { panic!("one item") };
    for row in &item.tables[0].rows {
        println!("{}", row.join(" | "));
    }
    // What is believed of D²/η, and of D, is in the rate: twice 0.3 % less 0.03 %, and 0.3 %, the harmonics' part aside.
    let median = |way: usize| -> f64 {
        let cell = &item.tables[0].rows[way][1];
        cell.split_whitespace().next().unwrap().parse().unwrap()
    };
    assert!((median(6) - 5700.0).abs() < 200.0 && (median(5) - 3000.0).abs() < 300.0);
    // The gains' 0.03 %, and what one identification knows of them.
    assert!((median(4) - 300.0).abs() < 500.0);
    for (way, bar) in [(0, 20.0), (1, 150.0), (2, 20.0), (3, 150.0)] {
        assert!(median(way).abs() < bar, "{way}");
    }
    for check in &item.checks {
        println!("{}: paper {}, ours {}", check.subject(), check.paper(), check.ours());
        assert!(check.holds(), "{check:?}");
    }
}
