// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Netpbm files: what is read has the size that its header says, and reads back as it is written.
#include <algorithm>
#include <cstddef>
#include <cstdint>

#include <cairn/core/check.hpp>
#include <cairn/io/netpbm.hpp>

#include "fuzz/scratch.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using cairn_fuzz::expect;
  static const cairn_fuzz::Scratch scratch;
  try {
    const auto file = scratch.put("image", cairn_fuzz::text_of(data, size));
    const cairn::Netpbm image = cairn::read_netpbm(file);
    const auto count = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height) *
                       static_cast<std::size_t>(image.channels);
    expect(image.samples.size() == count, "as many samples as the header says");
    expect(std::ranges::all_of(image.samples, [&](int sample) { return sample <= image.largest; }),
           "no sample above the largest");
    cairn::write_netpbm(scratch / "again", image);
    const cairn::Netpbm again = cairn::read_netpbm(scratch / "again");
    expect(again.width == image.width && again.height == image.height && again.channels == image.channels &&
               again.largest == image.largest && again.samples == image.samples,
           "a written image reads back");
    const cairn::Image grey = cairn::read_pgm(file);
    expect(grey.width() == image.width && grey.height() == image.height, "the grey image has the same size");
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
