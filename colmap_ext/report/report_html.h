// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace adasfm {

// The page with {{NAME}} where the parts go; made of report_template.html when
// the program is built.
extern const char kReportTemplate[];

// Text of any origin for HTML's text and quoted attributes.
std::string EscapeHtml(const std::string& text);

// JSON for the inside of a <script> element, which no string in it can end.
// Text that is not UTF-8 (file names) is made so.
std::string JsonForScript(const nlohmann::json& json);

std::string EncodeBase64(const void* data, size_t num_bytes);

// Numbers as {"<type>": base64}, little-endian: a tenth of the size of decimal
// digits for the points' positions, and read at once.
nlohmann::json PackFloats(const std::vector<float>& values);         // f32
nlohmann::json PackUint16(const std::vector<uint16_t>& values);      // u16
nlohmann::json PackUint32(const std::vector<uint32_t>& values);      // u32
nlohmann::json PackBytes(const std::vector<unsigned char>& values);  // u8

// A figure of the header: `label`, `value` with its unit, and what it means.
struct ReportFigure {
  std::string label;
  std::string value;
  std::string note;
};
std::string FormatFigures(const std::vector<ReportFigure>& figures);

// A table with a head; empty text for a table without rows.
struct ReportTable {
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows;
};
std::string FormatTable(const ReportTable& table);

// Puts the values in the place of their {{NAME}}, which may occur in the
// template only; throws std::invalid_argument for a name without value.
std::string FillTemplate(const std::string& text,
                         const std::map<std::string, std::string>& values);

// printf for one number, e.g. FormatNumber("%.2f px", 0.5).
std::string FormatNumber(const char* format, double value);
// With thousands separated, e.g. 12,345.
std::string FormatCount(int64_t count);

}  // namespace adasfm
