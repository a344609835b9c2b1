// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "colmap_ext/commands/command.h"
#include "core/check_options.h"

namespace adasfm {

// An option of a command, and the field of `Options` that it sets.
template <typename Options>
struct OptionCase {
  std::string name;
  // A valid value, other than the default.
  double value;
  std::function<double(const Options&)> get;
};

// Makes an OptionCase of option "AdaSfm" name and this member of `Options`, for
// tests that name their struct so.
#define ADASFM_OPTION(name, value, member)                      \
  {                                                             \
    "AdaSfm" name, value,                                       \
        [](const Options& all) -> double { return all.member; } \
  }

template <typename Options>
using OptionAdder = void (*)(Options*, CommandOptions*);

template <typename Options>
Status ParseWords(const std::vector<std::string>& words,
                  OptionAdder<Options> add, Options* options) {
  CommandOptions command("test", "A test.");
  add(options, &command);
  std::vector<const char*> argv = {"test"};
  for (const std::string& word : words) argv.push_back(word.c_str());
  return command.Parse(argv.size(), argv.data());
}

// Each option sets its field, stays valid, and changes no other field.
template <typename Options>
void ExpectEachSetsItsOwnField(const std::vector<OptionCase<Options>>& cases,
                               OptionAdder<Options> add) {
  for (const OptionCase<Options>& option : cases) {
    Options options;
    EXPECT_NE(option.get(options), option.value) << option.name;
    const Status parsed = ParseWords<Options>(
        {"--" + option.name, OptionText(option.value)}, add, &options);
    ASSERT_TRUE(parsed.ok()) << parsed.message();
    EXPECT_EQ(option.get(options), option.value) << option.name;
    const Status valid = CheckOptions(options);
    EXPECT_TRUE(valid.ok()) << option.name << ": " << valid.message();
    for (const OptionCase<Options>& other : cases) {
      if (&other == &option) continue;
      EXPECT_EQ(other.get(options), other.get(Options()))
          << option.name << " changes " << other.name;
    }
  }
}

// -7 is invalid for nearly all options: the error must name the option as
// typed. Returns the number of options that reject it.
template <typename Options>
int ExpectWrongValuesAreNamed(const std::vector<OptionCase<Options>>& cases,
                              OptionAdder<Options> add) {
  int num_refused = 0;
  for (const OptionCase<Options>& option : cases) {
    Options options;
    CommandOptions command("test", "A test.");
    add(&options, &command);
    const std::string word = "--" + option.name;
    const char* argv[] = {"test", word.c_str(), "-7"};
    if (!command.Parse(3, argv).ok()) continue;  // a switch
    const Status status =
        command.Check([&options] { return CheckOptions(options); });
    if (status.ok()) continue;
    ++num_refused;
    EXPECT_NE(status.message().find(option.name), std::string::npos)
        << option.name << ": " << status.message();
  }
  return num_refused;
}

// The help lists exactly the AdaSfm options that have a case.
template <typename Options>
void ExpectHelpNamesAll(const std::vector<OptionCase<Options>>& cases,
                        OptionAdder<Options> add) {
  testing::internal::CaptureStdout();
  Options options;
  const bool parsed = ParseWords<Options>({"-h"}, add, &options).ok();
  const std::string help = testing::internal::GetCapturedStdout();
  EXPECT_TRUE(parsed);
  size_t num_listed = 0;
  for (size_t at = help.find("--AdaSfm"); at != std::string::npos;
       at = help.find("--AdaSfm", at + 1)) {
    ++num_listed;
  }
  EXPECT_EQ(num_listed, cases.size());
  for (const OptionCase<Options>& option : cases) {
    EXPECT_NE(help.find("--" + option.name + " "), std::string::npos)
        << option.name;
  }
}

}  // namespace adasfm
