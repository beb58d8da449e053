// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Code compiled for more than the target's instructions, and whether the processor at hand has them.
///
/// What a kernel is compiled for and what is asked before it runs are one list, so that none is forgotten.
/// The operations and their order are the same in each, but AVX-512 fuses multiply and add, so the last bit
/// of a sum of products may differ between processors (never between runs or thread counts on one).
#pragma once

#include <cairn/version.hpp>

/// Instructions that code is compiled for: has("one") join has("the next") ... Each includes those above.
#define CAIRN_AVX2(has, join) has("avx2")
#define CAIRN_AVX512(has, join) \
  has("avx512f") join has("avx512bw") join has("avx512vl") join has("avx512dq") join CAIRN_AVX2(has, join)
#define CAIRN_AVX512_VNNI(has, join) CAIRN_AVX512(has, join) join has("avx512vnni")

/// As attributes of a function, on x86-64 only: [[CAIRN_TARGET(AVX2)]].
#define CAIRN_TARGET(instructions) gnu::target(CAIRN_##instructions(CAIRN_NAME_OF, ","))
#define CAIRN_NAME_OF(name) name

/// The most of these of a processor of which has("a name") tells what it has.
#define CAIRN_PROCESSOR(has)                                            \
  (CAIRN_AVX512_VNNI(has, &&) ? ::cairn::detail::Processor::avx512_vnni \
   : CAIRN_AVX512(has, &&)    ? ::cairn::detail::Processor::avx512      \
   : CAIRN_AVX2(has, &&)      ? ::cairn::detail::Processor::avx2        \
                              : ::cairn::detail::Processor::plain)

/// Attribute of a lambda given to with_widest_lanes() or with_avx2_lanes().
#define CAIRN_INLINED __attribute__((always_inline))

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// By what it has more than the one before.
enum class Processor { plain, avx2, avx512, avx512_vnni };

/// The one at hand. Tests set it to compare the paths; not synchronised.
inline Processor& processor() noexcept {
#if defined(__x86_64__)
  static Processor at_hand = CAIRN_PROCESSOR(__builtin_cpu_supports);
#else
  static Processor at_hand = Processor::plain;
#endif
  return at_hand;
}

#if defined(__x86_64__)
template <class Body>
[[CAIRN_TARGET(AVX512), gnu::noinline]] void with_avx512(Body& body) {
  body();
}
template <class Body>
[[CAIRN_TARGET(AVX2), gnu::noinline]] auto with_avx2(Body& body) {
  return body();
}
#endif

/// Runs body() compiled for the widest vectors at hand; everything that it calls must be inlined.
template <class Body>
inline void with_widest_lanes(Body body) {
#if defined(__x86_64__)
  if (processor() >= Processor::avx512) return with_avx512(body);
  if (processor() == Processor::avx2) return with_avx2(body);
#endif
  body();
}

/// The same up to AVX2, which fuses nothing: every processor gives the same bits. One version is enough
/// where the target has AVX2 anyway.
template <class Body>
inline auto with_avx2_lanes(Body body) {
#if defined(__x86_64__) && !defined(__AVX2__)
  if (processor() >= Processor::avx2) return with_avx2(body);
#endif
  return body();
}

}}}  // namespace cairn::CAIRN_ABI::detail
