// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sqlite.h"
#include "core/status.h"

namespace adasfm {

// COLMAP 3.6 to 4.2 differ in their tables (docs/reference/formats.md). The
// number in user_version does not tell them apart: 3.9 to 3.13 write the same
// one, and an older program stamps its own over a newer file. What a file can
// do is looked up by its tables and columns.

bool HasColumn(SqliteConnection* database, const std::string& table,
               const std::string& column);

// An error, naming it, when a table or column is missing that every COLMAP
// since 3.6 writes.
Status CheckColumns(const std::string& path, SqliteConnection* database);

// The tables of a COLMAP newer than 3.8. The library of 3.8 must not open a
// file that has any: it would stamp its version and end the process.
std::vector<std::string> FindNewerTables(SqliteConnection* database);

// Whether the file has COLMAP 3.10's form, which COLMAP 4 leaves half
// converted: its pose_priors lack the column position_covariance.
bool IsHalfConvertible(SqliteConnection* database);

// Why the linked library must not open the file, to follow its name; empty when
// it may. The answer of each host/vN.
std::string WhyLibraryMustNotOpen(SqliteConnection* database);

// An error for a file that the linked library must not open. A file that does
// not exist yet, or is empty, may be opened. Changes nothing.
Status CheckLibraryOpens(const std::string& database_path);

// Whether the file has COLMAP 4's form, in which a two-view geometry's missing
// pose or matrix is NULL, and zeros and the identity are values.
bool StoresMissingAsNull(SqliteConnection* database);

// Adds the columns qvec and tvec to two_view_geometries when they are missing,
// as COLMAP 3.7 and later do with a file of COLMAP 3.6.
void AddPoseColumns(SqliteConnection* database);

}  // namespace adasfm
