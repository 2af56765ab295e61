#!/usr/bin/env python3
"""Makes up a record of a shard's result, with a digest of its own, as whoever lies would."""

import json
import sys
from pathlib import Path

IV = [0x6A09E667, 0xBB67AE85, 0x3C6EF372, 0xA54FF53A, 0x510E527F, 0x9B05688C, 0x1F83D9AB, 0x5BE0CD19]
ORDER = [2, 6, 3, 10, 7, 0, 4, 13, 1, 11, 12, 5, 9, 14, 15, 8]
CHUNK_START, CHUNK_END, PARENT, ROOT = 1, 2, 4, 8
MASK = 0xFFFFFFFF


def compressed(chaining, block, counter, length, flags):
    v = [*chaining, *IV[:4], counter & MASK, counter >> 32, length, flags]
    m = list(block)

    def mix(a, b, c, d, x, y):
        for word, (first, second) in ((x, (16, 12)), (y, (8, 7))):
            v[a] = (v[a] + v[b] + word) & MASK
            v[d] = turned(v[d] ^ v[a], first)
            v[c] = (v[c] + v[d]) & MASK
            v[b] = turned(v[b] ^ v[c], second)

    for number in range(7):
        for place, (a, b, c, d) in enumerate([(0, 4, 8, 12), (1, 5, 9, 13), (2, 6, 10, 14), (3, 7, 11, 15),
                                              (0, 5, 10, 15), (1, 6, 11, 12), (2, 7, 8, 13), (3, 4, 9, 14)]):
            mix(a, b, c, d, m[2 * place], m[2 * place + 1])
        m = [m[place] for place in ORDER]
    return [v[i] ^ v[i + 8] for i in range(8)]


def turned(word, by):
    return (word >> by | word << (32 - by)) & MASK


def words(block):
    block = block.ljust(64, b"\0")
    return [int.from_bytes(block[i:i + 4], "little") for i in range(0, 64, 4)]


def blake3(content):
    """BLAKE3, hex digits."""
    def node(first, last):
        # The last step is left open: the root has a flag of its own.
        if last - first == 1:
            chunk = content[first * 1024:(first + 1) * 1024]
            blocks = [chunk[i:i + 64] for i in range(0, len(chunk), 64)] or [b""]
            chaining = IV
            for i, block in enumerate(blocks):
                flags = (CHUNK_START if i == 0 else 0) | (CHUNK_END if i == len(blocks) - 1 else 0)
                if i == len(blocks) - 1:
                    return chaining, words(block), first, len(block), flags
                chaining = compressed(chaining, words(block), first, len(block), flags)
        left = 1 << ((last - first - 1).bit_length() - 1)
        return IV, compressed(*node(first, first + left)) + compressed(*node(first + left, last)), 0, 64, PARENT

    chaining, block, counter, length, flags = node(0, max(1, -(-len(content) // 1024)))
    return b"".join(word.to_bytes(4, "little") for word in compressed(chaining, block, counter, length, flags | ROOT)).hex()


def main(result):
    lines = result.read_text().splitlines()
    place = next(place for place, line in enumerate(lines) if '"outcome"' in line)
    # The record's own bytes, as they stand in the line.
    record = lines[place].split('"record":', 1)[1][:-1]
    line = json.loads(lines[place])
    assert blake3(record.encode()) == line["digest"], "this is not how evodrive names records"
    assert '"decision":' in record
    made_up = json.loads(record) | {"decision": "made up"}
    made_up = json.dumps(made_up, separators=(",", ":"))
    lines[place] = f'{{"task":"{line["task"]}","digest":"{blake3(made_up.encode())}","record":{made_up}}}'
    result.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
