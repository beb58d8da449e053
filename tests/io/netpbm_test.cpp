// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/io/netpbm.hpp>
#include <cairn/vision/image.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

using cairn::Image;
using cairn::Netpbm;
using cairn_test::Folder;
using cairn_test::message_of;

TEST_SUITE("netpbm") {
  TEST_CASE("netpbm: an image reads back as it was written, also through a view with a stride") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    Image image(37, 21);
    for (int y = 0; y < 21; ++y)
      for (int x = 0; x < 37; ++x) image(x, y) = static_cast<std::uint8_t>(random.below(256));
    const Folder folder;
    cairn::write_pgm(folder / "whole.pgm", image);
    CHECK((cairn::read_pgm(folder / "whole.pgm") == image));
    cairn::write_pgm(folder / "part.pgm", cairn::ImageView(image.row(3) + 5, 11, 7, 37));
    const Image part = cairn::read_pgm(folder / "part.pgm");
    REQUIRE(part.width() == 11);
    REQUIRE(part.height() == 7);
    for (int y = 0; y < 7; ++y)
      for (int x = 0; x < 11; ++x) CHECK(part(x, y) == image(x + 5, y + 3));
  }

  TEST_CASE("netpbm: 8 and 16 bits, grey and colour, all come back") {
    cairn::Random random(5);
    const Folder folder;
    for (const int channels : {1, 3})
      for (const int largest : {1, 255, 256, 1000, 65535}) {
        CAPTURE(channels);
        CAPTURE(largest);
        Netpbm image{5, 4, channels, largest, {}};
        for (int i = 0; i < 20 * channels; ++i)
          image.samples.push_back(
              static_cast<std::uint16_t>(random.below(static_cast<std::uint64_t>(largest) + 1)));
        cairn::write_netpbm(folder / "a", image);
        const Netpbm back = cairn::read_netpbm(folder / "a");
        CHECK(back.width == 5);
        CHECK(back.height == 4);
        CHECK(back.channels == channels);
        CHECK(back.largest == largest);
        CHECK(back.samples == image.samples);
      }
  }

  TEST_CASE("netpbm: plain files with comments, and what grey means") {
    const Folder folder;
    folder.put("p2", "P2 # made by hand\n3 1 # size\n100\n0 50\n# between\n100");
    const Image grey = cairn::read_pgm(folder / "p2");
    CHECK(grey(0, 0) == 0);
    CHECK(grey(1, 0) == 128);  // 127.5 rounds up
    CHECK(grey(2, 0) == 255);
    folder.put("p3", "P3 4 1 255  255 0 0  0 255 0  0 0 255  255 255 255\n");
    const Image colours = cairn::read_pgm(folder / "p3");
    CHECK(colours(0, 0) == 76);   // 0.299 * 255 = 76.2
    CHECK(colours(1, 0) == 150);  // 0.587 * 255 = 149.7
    CHECK(colours(2, 0) == 29);   // 0.114 * 255 = 29.1
    CHECK(colours(3, 0) == 255);
  }

  TEST_CASE("netpbm: a sixteen-bit sample has its high byte first") {
    const Folder folder;
    folder.put("a", std::string("P5 1 1 65535\n\x01\x02", 15));
    CHECK(cairn::read_netpbm(folder / "a").samples[0] == 258);
  }

  TEST_CASE("netpbm: bad files are refused by name and without taking memory for them") {
    const Folder folder;
    const auto refusal = [&](const std::string& bytes) {
      folder.put("bad.pgm", bytes);
      return message_of([&] { static_cast<void>(cairn::read_netpbm(folder / "bad.pgm")); });
    };
    CHECK(refusal("\x89PNG").find("bad.pgm: expected a PGM or PPM image") != std::string::npos);
    CHECK(refusal("").find("PGM or PPM") != std::string::npos);
    CHECK(refusal("P5 2 2 255\nabc").find("expected 4 bytes of samples, found 3") != std::string::npos);
    CHECK(refusal("P5 1000000 1000000 65535\nabc").find("expected 2000000000000 bytes") != std::string::npos);
    CHECK(refusal("P2 100000 100000 255\n1 2").find("bytes of samples") != std::string::npos);
    CHECK(refusal("P5 0 2 255\n").find("the width between 1") != std::string::npos);
    CHECK(refusal("P5 -3 2 255\n").find("found '-3'") != std::string::npos);
    CHECK(refusal("P5 2 99999999999 255\n").find("the height") != std::string::npos);
    CHECK(refusal("P5 2 2 65536\nabcdefgh").find("the largest sample value") != std::string::npos);
    CHECK(refusal("P5 2").find("the height") != std::string::npos);
    CHECK(refusal("P5 1 1 100\n\xff").find("samples of at most 100, found 255") != std::string::npos);
    CHECK(refusal("P2 2 1 100\n7 x").find("a sample between 0 and 100 at byte") != std::string::npos);
    CHECK(refusal("P2 3 1 10\n1    2 ").find("a sample") != std::string::npos);
  }

  TEST_CASE("netpbm: a header is what the format says, to the blank") {
    const Folder folder;
    const auto refusal = [&](const std::string& bytes) {
      folder.put("bad.pgm", bytes);
      return message_of([&] { static_cast<void>(cairn::read_netpbm(folder / "bad.pgm")); });
    };
    CHECK(refusal("P53 2 255\nabcdef").find("and a blank at its start") != std::string::npos);
    CHECK(refusal("P23 2 255 1 2 3 4 5 6").find("and a blank at its start") != std::string::npos);
    CHECK(refusal("P5x 2 1 255\nab").find("and a blank at its start") != std::string::npos);
    CHECK(refusal("P5 +2 1 255\nab").find("found '+2'") != std::string::npos);
    CHECK(refusal("P5 2 1 255#comment\nab").find("a blank after the largest sample value, at byte 10") !=
          std::string::npos);
    CHECK(refusal("P5#c\n2 1 255\nab").empty());
    CHECK(refusal("P5\t2\r1\n255\tab").empty());
  }

  TEST_CASE("netpbm: nothing may follow an image but the blanks and comments of a plain one") {
    const Folder folder;
    const auto refusal = [&](const std::string& bytes) {
      folder.put("bad.pgm", bytes);
      return message_of([&] { static_cast<void>(cairn::read_netpbm(folder / "bad.pgm")); });
    };
    CHECK(refusal("P5 2 1 255\nab\n").find("the end of the file after one image, found 1 bytes more") !=
          std::string::npos);
    CHECK(refusal("P5 2 1 255\nabP5 2 1 255\ncd").find("found 13 bytes more") != std::string::npos);
    CHECK(refusal("P5 2 1 255\r\nab").find("found 1 bytes more") != std::string::npos);  // one blank, not two
    CHECK(refusal("P6 1 1 65535\nabcdefg").find("found 1 bytes more") != std::string::npos);
    CHECK(refusal("P2 2 1 255\n1 2 3").find("found 1 bytes more") != std::string::npos);
    CHECK(refusal("P2 2 1 255\n1 2 trailing").find("found 8 bytes more") != std::string::npos);
    CHECK(refusal("P2 2 1 255\n1 2 \t\r\n# and no more").empty());
    CHECK(refusal("P3 1 1 255\n1 2 3\n\n").empty());
  }

  TEST_CASE("netpbm: what would not read back is not written") {
    const Folder folder;
    for (const int largest : {1, 100, 255, 256, 1000}) {
      const Netpbm image{2, 1, 1, largest, {0, static_cast<std::uint16_t>(largest + 1)}};
      CHECK(message_of([&] { cairn::write_netpbm(folder / "a", image); }) ==
            (folder / "a").string() + ": not written, expected samples of at most " +
                std::to_string(largest) + ", found " + std::to_string(largest + 1));
    }
    CHECK_FALSE(std::filesystem::exists(folder / "a"));
    const auto previous = cairn::set_violation_handler(
        [](const cairn::Violation& violation) { throw std::logic_error(violation.sentence); });
    CHECK_THROWS_AS(cairn::write_pgm(folder / "a", cairn::ImageView()), std::logic_error);
    cairn::set_violation_handler(previous);
  }

  TEST_CASE("netpbm: every truncation of a valid file is refused, none crashes") {
    const Folder folder;
    const std::string whole = "P6 # c\n2 2\n300\n" + std::string(24, '\0');
    for (std::size_t length = 0; length < whole.size(); ++length) {
      folder.put("cut", whole.substr(0, length));
      CHECK(message_of([&] { static_cast<void>(cairn::read_netpbm(folder / "cut")); }).find("expected") !=
            std::string::npos);
    }
    folder.put("whole", whole);
    CHECK(cairn::read_netpbm(folder / "whole").samples.size() == 12);
  }
}
