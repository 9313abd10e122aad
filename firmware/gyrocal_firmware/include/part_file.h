/* The file of its maker that some sensors want at each start (docs/board.md, Sensors). `gyrocal firmware DIR --part-file FILE` writes
   it here; as shipped there is none. */
#ifndef PART_FILE_H
#define PART_FILE_H

#define PART_FILE_BYTES 0

#endif
