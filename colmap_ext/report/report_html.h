// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace adasfm {

// The page with {{NAME}} in place of its parts, generated from
// report_template.html at build time.
extern const char kReportTemplate[];

// Escapes a text for HTML's text and quoted attributes.
std::string EscapeHtml(const std::string& text);

// JSON for the inside of a <script> element; no string in it can end the
// element. Invalid UTF-8, for example in file names, is replaced.
std::string JsonForScript(const nlohmann::json& json);

std::string EncodeBase64(const void* data, size_t num_bytes);

// Numbers as {"<type>": base64}, little-endian: for the points' positions a
// tenth of the size of decimal digits, and fast to read.
nlohmann::json PackFloats(const std::vector<float>& values);         // f32
nlohmann::json PackUint16(const std::vector<uint16_t>& values);      // u16
nlohmann::json PackUint32(const std::vector<uint32_t>& values);      // u32
nlohmann::json PackBytes(const std::vector<unsigned char>& values);  // u8

// A figure of the header: `label`, `value` with its unit, and an explanation.
struct ReportFigure {
  std::string label;
  std::string value;
  std::string note;
};
std::string FormatFigures(const std::vector<ReportFigure>& figures);

// A table with a head; FormatTable returns an empty text without rows.
struct ReportTable {
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows;
};
std::string FormatTable(const ReportTable& table);

// Replaces each {{NAME}} in the template, but not in the values; throws
// std::invalid_argument for a name without value.
std::string FillTemplate(const std::string& text,
                         const std::map<std::string, std::string>& values);

// printf for one number, e.g. FormatNumber("%.2f px", 0.5).
std::string FormatNumber(const char* format, double value);
// With thousands separated, e.g. 12,345.
std::string FormatCount(int64_t count);

}  // namespace adasfm
