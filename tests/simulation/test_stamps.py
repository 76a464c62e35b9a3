"""SUMO's files of one case are the same bytes each time: they say neither when nor where they were written."""

from pathlib import Path

from builders import paper_layout

from wzsumo.simulation.network import remove_stamp, write_network


def test_network_of_a_zone_is_the_same_bytes_wherever_it_is_written(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_network(paper_layout(), tmp_path / name)
    first, second = ((tmp_path / name / "zone.net.xml").read_bytes() for name in ("a", "b"))
    assert first == second
    assert str(tmp_path).encode() not in first


def test_only_the_comment_of_the_stamp_is_removed(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    path.write_text('<?xml version="1.0"?>\n<!-- generated on 2026 by SUMO\n<a/> -->\n\n<net><!-- kept --></net>\n')
    remove_stamp(path)
    assert path.read_text() == '<?xml version="1.0"?>\n<net><!-- kept --></net>\n'
    remove_stamp(path)
    assert path.read_text() == '<?xml version="1.0"?>\n<net><!-- kept --></net>\n'
