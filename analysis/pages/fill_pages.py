"""Put the figures of docs/results/ into the pages, and say which are older than the code that decides them.

    python analysis/pages/fill_pages.py [--check] [--measured TOPIC[.NAME] ...] [--commit HASH]

--check writes nothing, and ends with 1 where a page says other than its files. --measured: these were measured with the code
as it is, or as it was in the commit.
"""

import argparse
import sys

from code_parts import ROOT
from markers import filled, pages
from records import read_records, stamp


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--measured", nargs="+", default=[], metavar="TOPIC[.NAME]")
    parser.add_argument("--commit", help="the commit whose code measured them; default: the folder as it is")
    args = parser.parse_args()
    try:
        stamp(args.measured, commit=args.commit)
        records = read_records()
        texts = {page: page.read_text(encoding="utf-8") for page in pages()}
        new = {page: filled(text, records) for page, text in texts.items()}
    except (ValueError, LookupError) as error:
        print(error, file=sys.stderr)
        return 2
    differing = [page for page, text in texts.items() if new[page] != text]
    if not args.check:
        for page in differing:
            page.write_text(new[page], encoding="utf-8")
        width = max(map(len, records))
        for record in records.values():
            age = f"older than the code: {', '.join(record.changed)}" if record.changed else "the present code"
            print(f"{record.name:<{width}}  {age}")
        older = sum(bool(record.changed) for record in records.values())
        print(f"\n{older} of {len(records)} results are older than the code that decides them; {len(differing)} pages changed")
        return 0
    for page in differing:
        print(f"{page.relative_to(ROOT)}: says other than its files; run make numbers", file=sys.stderr)
    return bool(differing)


if __name__ == "__main__":
    sys.exit(main())
